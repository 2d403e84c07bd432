#include <nanobind/nanobind.h>

#include "bindings.hpp"
#include "dualdrive/version.hpp"

NB_MODULE(_core, m) {
    using namespace dualdrive::python;
#ifdef NDEBUG
    // what a thread still holds when the program ends is no leak
    nanobind::set_leak_warnings(false);
#endif
    m.doc() = "The C++ core of dualdrive.";
    m.attr("__version__") = dualdrive::version();
    m.attr("__sundials_version__") = dualdrive::sundials_version();
    m.attr("__kernels__") = dualdrive::kernels_name();
    dualdrive::bind_waveform(m);
    bind_effect_types(m);
    bind_machine(m);
    bind_simulate(m);
    bind_ensemble(m);
    bind_linearise(m);
    bind_innovations(m);
}
