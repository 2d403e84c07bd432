// Coulomb friction, set-valued at rest: |T| ≤ F±, and T = −F± sign ω while the body moves
//
//   F± = F (1 ± a)     F  torque, N·m in the frame of the body;  a  asymmetry, −1 … 1
//
// Source: Coulomb's law as in Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083–1138, § 2.
// Validity: dry or boundary-lubricated contact, load constant. Breakaway equals the sliding level; where it is higher
// use `stribeck`. The asymmetry F a is, while the body moves, the same as a constant torque −F a: gravity, a torque
// offset.
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct Coulomb {
    S torque, asymmetry;

    static constexpr EffectText text{
        .name = "coulomb",
        .equation = "T = -torque * (1 + asymmetry * sign(speed)) * sign(speed); at rest any torque within those limits",
        .source = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083-1138",
        .validity = "dry or boundary-lubricated contact under constant load; breakaway equals sliding friction",
        .confused_with = "stribeck,sensor_offset",
        .places = "table,pinions,motors",
        .affine = true,
        .hypothesis = {.called = "Coulomb friction"},
    };

    static constexpr auto parameters() {
        return fields<Coulomb, S>({
            {&Coulomb::torque,
             {"torque", "N*m", non_negative, 0.0, 300.0, "sliding friction, mean of both directions"}},
            {&Coulomb::asymmetry,
             {"asymmetry", "", Bounds{-1.0, 1.0}, 0.0, 0.1,
              "excess in the positive direction, lack in the negative, as a fraction"}},
        });
    }

    S friction_limit(const BodyPort<S>&, int direction) const { return torque * (1.0 + direction * asymmetry); }
};

}  // namespace dualdrive
