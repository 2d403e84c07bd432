// What of a machine or a signal travels in a pickle: what its own functions make it from, as plain Python objects.
#pragma once

#include <nanobind/nanobind.h>

#include "dualdrive/machine.hpp"
#include "dualdrive/waveform.hpp"

namespace dualdrive::python {

nanobind::tuple state_of(const Machine& machine);
Machine machine_of(const nanobind::tuple& state);  // std::invalid_argument for what is no such state

nanobind::tuple state_of(const Waveform& waveform);
Waveform waveform_of(const nanobind::tuple& state);

// Adds both halves to a class that is bound, so that pickle and copy.deepcopy work.
template <class T>
void pickles(nanobind::class_<T>& bound, T (*made_of)(const nanobind::tuple&)) {
    bound.def(
        "__getstate__", [](const T& self) { return state_of(self); },
        nanobind::sig("def __getstate__(self) -> tuple[typing.Any, ...]"));
    bound.def(
        "__setstate__", [made_of](T& self, const nanobind::tuple& state) { new (&self) T(made_of(state)); },
        nanobind::arg("state"), nanobind::sig("def __setstate__(self, state: tuple[typing.Any, ...], /) -> None"));
}

}  // namespace dualdrive::python
