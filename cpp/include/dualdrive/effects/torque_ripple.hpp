// Torque ripple of a motor: T = K_d I · a sin(n θ + φ), on top of K_d I
//
//   a  amplitude as a fraction of K_d I;  n  order per motor revolution;  φ  phase, rad;  θ  motor angle, rad
//
// Source: Holtz, Springob, "Identification and compensation of torque ripple in high-precision permanent magnet motor
// drives", IEEE Trans. Industrial Electronics 43 (1996) 309–320.
// Validity: one harmonic of the flux linkage, no saturation. A three-phase machine with p pole pairs shows order 6p; an
// offset or gain error of the current sensors shows p or 2p. It vanishes without current: that tells it from `cogging`.
// The back-EMF is left sinusoidal, so electrical and mechanical power differ by the ripple's share.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct TorqueRipple {
    S amplitude, order, phase;

    static constexpr EffectText text{
        .name = "torque_ripple",
        .equation = "T = amplitude * K_d * I * sin(order * angle + phase)",
        .source = "Holtz, Springob, IEEE Trans. Industrial Electronics 43 (1996) 309-320",
        .validity = "one harmonic, unsaturated motor",
        .confused_with = "cogging",
        .places = "motors",
        .hypothesis = {.carrier = "torque"},
    };

    static constexpr auto parameters() {
        return fields<TorqueRipple, S>({
            {&TorqueRipple::amplitude, {"amplitude", "", fraction, 0.0, 0.02, "ripple over the torque of the current"}},
            {&TorqueRipple::order, {"order", "", positive, 24.0, 6.0, "periods per revolution of the motor", true}},
            {&TorqueRipple::phase, {"phase", "rad", any, 0.0, 1.0, "phase at motor angle zero"}},
        });
    }

    S torque_of_motor(const MotorPort<S>& at) const {
        using std::sin;
        return amplitude * at.torque * sin(order * at.angle + phase);
    }
};

}  // namespace dualdrive
