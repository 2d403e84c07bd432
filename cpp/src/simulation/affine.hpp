// Whether a machine's laws are affine in the states while its modes are frozen.
#pragma once

#include <optional>
#include <string>

#include "dualdrive/machine.hpp"

namespace dualdrive {

// The label of the first effect that is not, or nothing. A formula is judged by its form (Expression::is_affine): numbers
// of its own are constants, what it reads of the machine is affine, and t is neither.
std::optional<std::string> effect_that_is_not_affine(const Machine& machine);

}  // namespace dualdrive
