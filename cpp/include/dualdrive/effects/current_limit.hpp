// Current limit of a drive, as a torque: |T*| ≤ T_max, with the speed loop's integrator frozen while it holds
//
//   T*  torque set-point = K_d I*, N·m at the motor;  T_max  its limit: K_d times the current limit
//
// Source: Leonhard, "Control of Electrical Drives", Springer: the speed controller's output is limited to protect
// converter and motor.
// Validity: a controller with speed loops; the current itself follows through the current loop and may overshoot a
// little. It is motor_n.T_max, the limit the drive has anyway; infinity is no limit.
#pragma once

#include "dualdrive/effect.hpp"
#include "dualdrive/motor.hpp"
#include "dualdrive/structural.hpp"

namespace dualdrive {

template <class S>
struct CurrentLimit {
    static constexpr EffectText text{
        .name = "current_limit",
        .equation = "|torque set-point| <= T_max, integrator frozen meanwhile; one number with motor_n.T_max",
        .source = "Leonhard, Control of Electrical Drives, Springer: limited speed controller",
        .validity = "a controlled drive; no limit until it is given a size",
        .confused_with = "voltage_limit,torque_constant_saturation",
        .places = "motors",
        .affine = true,
        .hypothesis = {.clips = true},
    };
    static constexpr Part part = Part::motor;
    static constexpr auto parameters() { return lent_by<Motor<S>>({"T_max"}); }
};

}  // namespace dualdrive
