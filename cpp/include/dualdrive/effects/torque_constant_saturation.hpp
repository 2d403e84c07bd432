// Saturation of the magnetic circuit: the torque constant falls with the current
//
//   T = K_d I / √(1 + 2 s x²),   x = K_d I / T_rated        (for small currents K_d I (1 − s x²))
//
//   s  share of the torque constant that is lost at rated torque, to first order;  T_rated  of the motor's data sheet
//
// Source: Hendershot, Miller, "Design of Brushless Permanent-Magnet Machines", 2010: torque against current bends as
// teeth and yoke saturate.
// Validity: quasi-static, cross-saturation and the back-EMF left out. The parabola alone would turn negative; this form
// has its curvature, grows with the current for every s and tends to T_rated / √(2 s).
// The drive does not know it: it regulates the current and takes K_d I for the torque.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct TorqueConstantSaturation {
    S loss;

    static constexpr EffectText text{
        .name = "torque_constant_saturation",
        .equation = "T = K_d I / sqrt(1 + 2 * loss * (K_d I / T_rated)^2)",
        .source = "Hendershot, Miller, Design of Brushless Permanent-Magnet Machines, 2010",
        .validity = "quasi-static; the motor's T_rated must be known",
        .confused_with = "thermal_drift,current_limit",
        .places = "motors",
        .of_rating = true,
        .hypothesis = {.clips = true, .scales = true},
    };

    static constexpr auto parameters() {
        return fields<TorqueConstantSaturation, S>({
            {&TorqueConstantSaturation::loss,
             {"loss", "", non_negative, 0.0, 0.1, "share of the torque constant lost at rated torque, to first order"}},
        });
    }

    S torque_of_motor(const MotorPort<S>& at) const {
        using std::sqrt;
        const S x = at.torque / at.rated_torque;
        return at.torque * (1.0 / sqrt(1.0 + 2.0 * loss * x * x) - 1.0);
    }
};

}  // namespace dualdrive
