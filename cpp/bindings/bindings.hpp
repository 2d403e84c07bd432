// Each part of the core binds itself; module.cpp is the table of contents.
#pragma once

#include <nanobind/nanobind.h>

namespace dualdrive {
void bind_waveform(nanobind::module_& m);
}

namespace dualdrive::python {

namespace nb = nanobind;

void bind_effect_types(nb::module_& m);
void bind_machine(nb::module_& m);
void bind_simulate(nb::module_& m);
void bind_ensemble(nb::module_& m);
void bind_linearise(nb::module_& m);
void bind_innovations(nb::module_& m);

}  // namespace dualdrive::python
