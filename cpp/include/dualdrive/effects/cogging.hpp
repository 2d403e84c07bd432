// Cogging of a permanent-magnet motor: T = a sin(n θ + φ), with or without current
//
//   a  amplitude, N·m;  n  order per revolution of the body;  φ  phase, rad;  θ  angle of the body, rad
//
// Source: Zhu, Howe, "Influence of design parameters on cogging torque in permanent magnet machines", IEEE Trans. Energy
// Conversion 15 (2000) 407–412: the fundamental has order lcm(slots, poles).
// Validity: one harmonic. The torque is the derivative of the energy a cos(nθ + φ)/n, so it does no work over a turn.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct Cogging {
    S amplitude, order, phase;

    static constexpr EffectText text{
        .name = "cogging",
        .equation = "T = amplitude * sin(order * angle + phase)",
        .source = "Zhu, Howe, IEEE Trans. Energy Conversion 15 (2000) 407-412",
        .validity = "one harmonic of a permanent-magnet motor; order = lcm(slots, poles) for the fundamental",
        .confused_with = "torque_ripple",
        .places = "motors",
    };

    static constexpr auto parameters() {
        return fields<Cogging, S>({
            {&Cogging::amplitude, {"amplitude", "N*m", non_negative, 0.0, 1.0, "half the peak-to-peak torque"}},
            {&Cogging::order, {"order", "", positive, 24.0, 6.0, "periods per revolution of the body", true}},
            {&Cogging::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero"}},
        });
    }

    S torque_on_body(const BodyPort<S>& at) const {
        using std::sin;
        return amplitude * sin(order * at.angle + phase);
    }
};

}  // namespace dualdrive
