// Gravity on a body whose axis is inclined and whose centre of mass is off it: T = a cos(θ + φ)
//
//   a = m g r sin β  amplitude, N·m: mass, gravity, offset of the centre of mass, inclination of the axis to the vertical;
//   φ  phase, rad
//
// Source: any text on statics, e.g. Meriam, Kraige, "Engineering Mechanics: Statics", Wiley.
// Validity: rigid body on a fixed axis. It has the potential −a sin(θ + φ): no work over a turn. Over a small arc it is a
// constant torque.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct Unbalance {
    S amplitude, phase;

    static constexpr EffectText text{
        .name = "unbalance",
        .equation = "T = amplitude * cos(angle + phase), amplitude = m * g * r * sin(inclination)",
        .source = "Meriam, Kraige, Engineering Mechanics: Statics, Wiley",
        .validity = "rigid body on a fixed inclined axis; over a small arc a constant torque",
        .confused_with = "coulomb,cutting_torque,position_dependent_inertia",
        .places = "table,pinions,motors",
        // a rotor is balanced
        .hypothesis = {.places = "table"},
    };

    static constexpr auto parameters() {
        return fields<Unbalance, S>({
            {&Unbalance::amplitude, {"amplitude", "N*m", non_negative, 0.0, 1e3, "largest torque over a turn"}},
            {&Unbalance::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero; 0: full torque there"}},
        });
    }

    S torque_on_body(const BodyPort<S>& at) const {
        using std::cos;
        return amplitude * cos(at.angle + phase);
    }
};

}  // namespace dualdrive
