// Dead time of the inverter: voltage is lost against the direction of the current
//
//   L İ + R I + C_e ω = U − U_d tanh(I / I_0)
//
//   U_d  voltage, V: DC-link voltage × dead time × switching frequency, and the drop of the switches;
//   I_0  zone, A: current ripple, within which the loss goes through zero
//
// Source: Jeong, Park, "The analysis and compensation of dead-time effects in PWM inverters", IEEE Trans. Industrial
// Electronics 38 (1991) 108–114.
// Validity: mean over a switching period, one axis of current; a motor with an electrical circuit (kind = armature). A
// fast current loop hides most of it: what is left shows around zero current. Invisible to a torque balance.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct DeadTime {
    S voltage, current;

    static constexpr EffectText text{
        .name = "dead_time",
        .equation = "U_motor = U - voltage * tanh(I / current)",
        .source = "Jeong, Park, IEEE Trans. Industrial Electronics 38 (1991) 108-114",
        .validity = "mean over a switching period; a motor with an electrical circuit",
        .confused_with = "coulomb,voltage_limit",
        .places = "motors",
    };

    static constexpr auto parameters() {
        return fields<DeadTime, S>({
            {&DeadTime::voltage, {"voltage", "V", non_negative, 0.0, 5.0, "lost where the current is large"}},
            {&DeadTime::current, {"current", "A", positive, 0.5, 0.5, "zone of the ripple around zero current"}},
        });
    }

    S voltage_of_motor(const MotorPort<S>& at) const {
        using std::tanh;
        return -(voltage * tanh(at.current / current));
    }
};

}  // namespace dualdrive
