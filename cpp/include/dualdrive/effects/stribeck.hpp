// Stribeck friction, the whole dry-friction law: Coulomb level and the rise towards rest, set-valued at rest
//
//   F(ω) = F_c [ 1 + (r − 1) exp(−(ω/ω_s)²) ],   T = −F(ω) sign ω,   |T| ≤ F_s = r F_c at rest
//
//   F_c  torque, N·m;  r = F_s/F_c  static ratio, usually 1.1 … 1.6;  ω_s  Stribeck speed, rad/s in the body's frame
//
// Source: Canudas de Wit, Olsson, Åström, Lischinsky, "A new model for control of systems with friction", IEEE Trans.
// Automatic Control 40 (1995) 419–425 (its g(v), σ0 → ∞); Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30 (1994).
// Validity: speed changes slowly against the film's build-up; no presliding. It carries the Coulomb level itself: it takes
// the place of a `coulomb` on the same body. With both, only the sum of their levels shows in data.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct Stribeck {
    S torque, static_ratio, speed;

    static constexpr EffectText text{
        .name = "stribeck",
        .equation =
            "T = -torque * (1 + (static_ratio - 1) * exp(-(speed / stribeck speed)^2)) * sign(speed); "
            "at rest any torque up to static_ratio * torque",
        .source = "Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425",
        .validity = "the whole law, in place of coulomb; quasi-static lubrication, no presliding",
        .confused_with = "coulomb,sensor_delay",
        .places = "table,pinions,motors",
        .hypothesis = {.called = "Stribeck friction", .contains = "coulomb"},
    };

    static constexpr auto parameters() {
        return fields<Stribeck, S>({
            {&Stribeck::torque, {"torque", "N*m", non_negative, 0.0, 300.0, "sliding friction far above `speed`"}},
            {&Stribeck::static_ratio,
             {"static_ratio", "", Bounds{1.0, infinity}, 1.3, 0.3, "breakaway torque over sliding friction"}},
            {&Stribeck::speed, {"speed", "rad/s", positive, 1e-3, 1e-3, "speed at which 37 % of the rise is left"}},
        });
    }

    S friction_limit(const BodyPort<S>& at, int /*direction*/) const {
        using std::exp;
        const S v = at.speed / speed;
        return torque * (1.0 + (static_ratio - 1.0) * exp(-(v * v)));
    }
};

}  // namespace dualdrive
