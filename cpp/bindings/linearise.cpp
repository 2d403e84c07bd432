#include "dualdrive/linearise.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "bindings.hpp"

namespace dualdrive::python {

void bind_linearise(nb::module_& m) {
    nb::class_<LinearSystem>(m, "LinearSystem",
                             "A machine while its modes are frozen: dz/dt = A z + a, signals = C z + c; SI.")
        .def_ro("states", &LinearSystem::states)
        .def_ro("signals", &LinearSystem::signals)
        .def_prop_ro(
            "A", [](const LinearSystem& s) { return view(s.A, {s.a.size(), s.a.size()}); }, "Shape (states, states).")
        .def_prop_ro(
            "a", [](const LinearSystem& s) { return view(s.a, {s.a.size()}); }, "Shape (states,).")
        .def_prop_ro(
            "C", [](const LinearSystem& s) { return view(s.C, {s.c.size(), s.a.size()}); }, "Shape (signals, states).")
        .def_prop_ro("c", [](const LinearSystem& s) { return view(s.c, {s.c.size()}); }, "Shape (signals,).");

    m.def("linearise", &linearise, nb::arg("machine"), nb::arg("inputs") = nb::dict(), nb::kw_only(),
          nb::arg("modes") = nb::dict(), nb::arg("state") = nb::dict(), nb::arg("t") = 0.0,
          "The machine as a linear system in given modes: exact where it is affine, else the tangent at `state`.\n\n"
          "modes: element -> mode by name, as events report them ({'mesh_1': 'front'}); others are gap, stuck, linear, "
          "positive.\n"
          "state: state -> value, others 0. Delays are left out. Raises ValueError for a name the machine does not "
          "have.");
}

}  // namespace dualdrive::python
