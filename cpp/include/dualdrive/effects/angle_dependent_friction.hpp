// Dry friction whose limit varies with the angle: F(θ) = a (1 + cos(nθ + φ)), on top of what else rubs
//
//   a  torque, N·m: the limit swings between 0 and 2a, so it can never turn into a drive;  n  order per revolution of the
//   body;  φ  phase, rad: the tightest place is at θ = −φ/n
//
// Source: Armstrong-Hélouvry, "Control of Machines with Friction", Kluwer 1991: position-dependent friction of gear
// teeth and bearings, found once and more times per revolution.
// Validity: one harmonic; dry friction, set-valued at rest, breakaway equal to sliding. Its mean a adds to a `coulomb` on
// the same body: a level F_c that swings by a fraction v is a coulomb of F_c (1 − v) with a = v F_c.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct AngleDependentFriction {
    S torque, order, phase;

    static constexpr EffectText text{
        .name = "angle_dependent_friction",
        .equation = "T = -torque * (1 + cos(order * angle + phase)) * sign(speed); at rest any torque within that",
        .source = "Armstrong-Helouvry, Control of Machines with Friction, Kluwer 1991",
        .validity = "one harmonic, on top of coulomb or stribeck; its mean adds to theirs",
        .confused_with = "coulomb,unbalance,cogging",
        .places = "table,pinions,motors",
        .hypothesis = {.carrier = "direction"},
    };

    static constexpr auto parameters() {
        using E = AngleDependentFriction;
        return fields<E, S>({
            {&E::torque, {"torque", "N*m", non_negative, 0.0, 300.0, "mean and amplitude of the limit"}},
            {&E::order, {"order", "", positive, 1.0, 1.0, "periods per revolution of the body", true}},
            {&E::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero; 0: tightest there"}},
        });
    }

    S friction_limit(const BodyPort<S>& at, int /*direction*/) const {
        using std::cos;
        return torque * (1.0 + cos(order * at.angle + phase));
    }
};

}  // namespace dualdrive
