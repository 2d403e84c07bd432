// Tension mismatch: the torque equaliser takes one drive's torque for more or less than it is
//
//   e_T = 2 [w T̂_1 − (1 − w) T̂_2] − T_ten,   with T̂_n (1 + ε) in place of T̂_n = K_d I_n
//
//   ε  error, a share of the torque of the drive it sits at
//
// With integral action and w = ½ the drives settle at T_1 − T_2 = T_ten + ε T_2: the tension varies with the load, which
// tells it from a wrong T_ten. Causes: gain of a current sensor, or a torque constant entered wrongly in one drive.
// Source: Song et al., "Analysis and compensation of current measurement errors in machine drive systems – a review",
// Energies 18 (2025) 1367: gain errors of current sensors; what they do here follows from the equaliser's law.
// Validity: two drives or more under the equaliser. The error is in what the drives tell each other; a drive whose own
// torque constant is off is motor_n.K_d.
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct TensionMismatch {
    S error;

    static constexpr EffectText text{
        .name = "tension_mismatch",
        .equation = "the equaliser reads K_d I * (1 + error)",
        .source = "Song et al., Energies 18 (2025) 1367: gain errors of current sensors",
        .validity = "drives under a torque equaliser; at one of them, not at all alike",
        .confused_with = "thermal_drift,sensor_offset",
        .places = "motor_2",
        .affine = true,
    };

    static constexpr auto parameters() {
        return fields<TensionMismatch, S>({
            {&TensionMismatch::error, {"error", "", Bounds{-1.0, infinity, true}, 0.0, 0.05, "share of the torque"}},
        });
    }

    S torque_estimate(const S& torque) const { return torque * (1.0 + error); }
};

}  // namespace dualdrive
