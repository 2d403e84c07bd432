#include <nanobind/nanobind.h>

#include "bindings.hpp"
#include "dualdrive/version.hpp"

NB_MODULE(_core, m) {
    using namespace dualdrive::python;
    m.doc() = "The C++ core of dualdrive.";
    m.attr("__version__") = dualdrive::version();
    m.attr("__sundials_version__") = dualdrive::sundials_version();
    m.attr("__kernels__") = dualdrive::kernels_name();
    dualdrive::bind_waveform(m);
    bind_machine(m);
    bind_simulate(m);
    bind_ensemble(m);
    bind_linearise(m);
    bind_innovations(m);
}
