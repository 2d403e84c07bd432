#include <nanobind/nanobind.h>

#include "dualdrive/version.hpp"

NB_MODULE(_core, m) {
    m.doc() = "The C++ core of dualdrive.";
    m.attr("__version__") = dualdrive::version();
    m.attr("__sundials_version__") = dualdrive::sundials_version();
}
