#include "dualdrive/linearise.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
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

    nb::class_<FrozenLaws>(m, "FrozenLaws", "Rates of the states and guards of the switches at one instant; SI.")
        .def_prop_ro(
            "rates", [](const FrozenLaws& l) { return view(l.rates, {l.rates.size()}); }, "Shape (states,).")
        .def_prop_ro(
            "guards", [](const FrozenLaws& l) { return view(l.guards, {l.guards.size()}); },
            "Shape (2 x switching elements,): positive while the element's mode lasts.")
        .def_prop_ro(
            "guard_slopes", [](const FrozenLaws& l) { return view(l.guard_slopes, {l.guard_slopes.size()}); },
            "Their derivatives along the flow, 1/s; empty where the model itself was asked.");

    m.def(
        "frozen_laws",
        [](const Machine& machine, const Inputs& inputs, const std::map<std::string, std::string>& modes,
           const std::map<std::string, double>& state, double t, std::pair<double, double> cell, bool matrices) {
            return frozen_laws(machine, inputs, modes, state, t, {cell.first, cell.second},
                               matrices ? LawsOf::matrices : LawsOf::model);
        },
        nb::arg("machine"), nb::arg("inputs") = nb::dict(), nb::kw_only(), nb::arg("modes") = nb::dict(),
        nb::arg("state") = nb::dict(), nb::arg("t") = 0.0, nb::arg("cell") = std::pair(Cell{}.low, Cell{}.high),
        nb::arg("matrices") = false,
        "The laws of given modes, from the model or from the matrices that engines use where a machine is affine.\n\n"
        "t, cell: s, the instant and the interval between knots of the inputs in which it lies.\n"
        "Other arguments and errors are those of linearise.");

    m.def("possible_modes", &possible_modes, nb::arg("machine"), nb::arg("inputs") = nb::dict(),
          "Switching element -> the modes that it may have, by name.");
}

}  // namespace dualdrive::python
