// Elements with modes: their guards and what may follow. A mode is a plain number that is frozen while the solver
// runs and changed only while it stands at a located switch.
//
// Every guard is written so that it is positive while its mode is valid; the mode ends where it falls through zero.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace dualdrive {

using Mode = std::int8_t;
using Modes = std::vector<Mode>;

// A connection with play: which flank carries. `parting`: flank overlapped but the damper would pull, so no torque.
namespace flank {
inline constexpr Mode back = -1, gap = 0, front = 1, back_parting = -2, front_parting = 2;
inline constexpr int side(Mode m) { return (m > 0) - (m < 0); }
inline constexpr bool carries(Mode m) { return m == front || m == back; }
}  // namespace flank

// Dry friction of a rigid group of bodies.
namespace stick {
inline constexpr Mode backward = -1, stuck = 0, forward = 1;
}

// A limited block. low/high: integrator frozen, driven outward; unwinding: saturated, integrator running inward;
// riding: the proportional part falls while the integrator would rise, so the output stays exactly on its limit and
// the integrator follows from it (the sliding mode of conditional integration; without it the loop would chatter).
namespace limiter {
inline constexpr Mode linear = 0, high = 1, low = -1, unwinding_high = 2, unwinding_low = -2, riding_high = 3,
                      riding_low = -3;
inline constexpr int side(Mode m) { return (m > 0) - (m < 0); }
inline constexpr bool saturated(Mode m) { return m != 0; }
inline constexpr bool riding(Mode m) { return m == 3 || m == -3; }
inline constexpr bool integrates(Mode m) { return m == 0 || m == 2 || m == -2; }
}  // namespace limiter

// The sign of an expression: abs, sign, min, max, if of a user's formula; the kinks of a tension schedule.
namespace branch {
inline constexpr Mode negative = -1, positive = 1;
}

enum class SwitchKind : std::uint8_t { flank, stick, limiter, branch };

struct Switch {
    SwitchKind kind;
    int index;         // connection, group, block, or slot of the branch argument
    std::string name;  // as events report it
};

// Each mode ends in at most two ways.
inline constexpr int guards_per_switch = 2;

const char* mode_name(SwitchKind kind, Mode mode);

}  // namespace dualdrive
