// Voltage limit of a drive: |U| ≤ U_max, with the current loop's integrator frozen while it holds
//
//   U  armature voltage, V;  U_max  its limit: what the converter has left of its DC link
//
// Source: Leonhard, "Control of Electrical Drives", Springer: the converter's voltage reserve bounds the rate of current
// and, with the back-EMF, the speed at which torque is left.
// Validity: a controlled motor with an electrical circuit (kind = armature). It is motor_n.U_max; infinity is no limit.
#pragma once

#include "dualdrive/effect.hpp"
#include "dualdrive/motor.hpp"
#include "dualdrive/structural.hpp"

namespace dualdrive {

template <class S>
struct VoltageLimit {
    static constexpr EffectText text{
        .name = "voltage_limit",
        .equation = "|voltage| <= U_max, integrator frozen meanwhile; one number with motor_n.U_max",
        .source = "Leonhard, Control of Electrical Drives, Springer: voltage reserve of the converter",
        .validity = "a controlled motor with an electrical circuit; no limit until it is given a size",
        .confused_with = "current_limit,dead_time",
        .places = "motors",
        .affine = true,
        .hypothesis = {.clips = true},
    };
    static constexpr Part part = Part::motor;
    static constexpr auto parameters() { return lent_by<Motor<S>>({"U_max"}); }
};

}  // namespace dualdrive
