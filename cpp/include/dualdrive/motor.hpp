// A motor: the armature circuit, Eq. 1, or a torque source whose current loop is too fast to matter.
#pragma once

#include "dualdrive/parameter.hpp"

namespace dualdrive {

// L İ + R I + C_e ω = U,  T = K_d I                                            (Eq. 1 and Eq. 2, corrected)
// With the reducer's Eq. 4 in it this is the armature circuit in pinion coordinates, Eq. 12 and Eq. 13: K_e = i C_e.
// A PMSM maps on to this with K_d = C_e = k_T/√3, I = √3·I_rms, U = U_LL,rms; R and L are per-phase values.
template <class S>
struct Motor {
    S K_d, C_e, R, L, U_max, T_max, T_rated, omega_max;
    S filter_pole, filter_pole_damping, filter_zero, filter_zero_damping;  // of the drive's torque set-point, Eq. C6

    static constexpr auto parameters() {
        return fields<Motor, S>({
            {&Motor::K_d, {"K_d", "N*m/A", positive, 1.0, 1.0, "torque constant"}},
            {&Motor::C_e,
             {"C_e", "V*s/rad", non_negative, 1.0, 1.0, "back-EMF constant; equals K_d when energy is conserved"}},
            {&Motor::R, {"R", "ohm", non_negative, 1.0, 1.0, "armature resistance"}},
            {&Motor::L, {"L", "H", positive, 1e-3, 1e-3, "armature inductance"}},
            {&Motor::U_max, {"U_max", "V", positive, infinity, 400.0, "voltage limit of the drive"}},
            {&Motor::T_max, {"T_max", "N*m", positive, infinity, 100.0, "torque (current) limit of the drive"}},
            {&Motor::T_rated, {"T_rated", "N*m", positive, infinity, 100.0, "rated torque: the base of percentages"}},
            {&Motor::omega_max, {"omega_max", "rad/s", positive, infinity, 100.0, "speed limit of the motor"}},
            {&Motor::filter_pole,
             {"filter_pole", "Hz", non_negative, 0.0, 100.0,
              "set-point filter of the drive: natural frequency of its denominator; 0 = no filter", true}},
            {&Motor::filter_pole_damping,
             {"filter_pole_damping", "", positive, 0.7, 0.5, "damping ratio of its denominator", true}},
            {&Motor::filter_zero,
             {"filter_zero", "Hz", non_negative, 0.0, 100.0,
              "natural frequency of its numerator: that of a notch; 0 = low-pass", true}},
            {&Motor::filter_zero_damping,
             {"filter_zero_damping", "", non_negative, 0.0, 0.1, "damping ratio of its numerator", true}},
        });
    }
};

// armature: current is a state. direct: the torque equals its set-point.
enum class MotorKind { armature, direct };

}  // namespace dualdrive
