// Every number the simulation knows, by name. SI; motor quantities in the motor's frame, pinion and
// mesh quantities in the pinion's. An effect that stands at its default is not there.
#pragma once

#include <array>
#include <cstddef>
#include <stdexcept>
#include <string>

namespace blind {

constexpr std::size_t max_drives = 4;
template <class T>
using PerDrive = std::array<T, max_drives>;

// clang-format off
#define BLIND_COMMON(X) \
    X(step, 2e-5) X(output_step, 2e-3) X(begin, 0) X(end, 1) \
    /* machine */ \
    X(drives, 2) X(i, 1) X(i_m, 1) X(J_m, 1) X(b_m, 0) X(open, 0) X(chain, 0) \
    /* controller */ \
    X(K_v, 0) X(K_i, 0) X(K_d_position, 0) X(tau_d, 0.02) X(f_v, 1) X(to_master, 1) X(to_slaves, 1) X(k_p, 0) X(T_N, 0) X(K_E, 0) X(T_E, 0) X(Omega_E, 1e9) X(Omega_max, 1e9) X(w, 0.5) \
    X(T_ten, 0) X(tau_t, 0) X(T_max, 1e9) X(U_max, 1e9) X(omega_ci, 1000) X(delta_t, 0) \
    X(position_sample, 0) X(tension_sample, 0) X(speed_sample, 0) \
    /* friction and load at the table */ \
    X(t_dry, 0) X(t_asymmetry, 0) X(t_ratio, 1) X(t_speed, 1) X(t_angle_dry, 0) X(t_angle_order, 1) X(t_angle_phase, 0) \
    X(t_lugre, 0) X(t_lugre_ratio, 1) X(t_lugre_speed, 1) X(t_lugre_stiffness, 1) X(t_lugre_damping, 0) \
    X(drag, 0) X(unbalance, 0) X(unbalance_phase, 0) X(inertia, 0) X(inertia_order, 1) X(inertia_phase, 0) \
    X(cut, 0) X(cut_ripple, 0) X(cut_frequency, 1) X(cut_from, 0) X(cut_to, 0) X(cut_rise, 0.02) \
    /* ring */ \
    X(ring, 0) X(ring_phase, 0) X(ring_spacing, 0) X(wear, 0) X(wear_at, 0) X(wear_width, 1) \
    /* sensing and control */ \
    X(table_delay, 0) X(table_ecc, 0) X(table_ecc_phase, 0) X(command_delay, 0) \
    /* outside every library */ \
    X(disturbed, 0) X(hum, 0) X(hum_frequency, 7) X(hum_slope, 0) X(hum_phase, 0) X(shove, 0) X(shove_at, 1e9) X(shove_rise, 1e-3) \
    X(cubic, 0) X(spot, 0) X(spot_at, 0) X(spot_width, 1) \
    X(second_J, 0) X(second_k, 0) X(second_c, 0) X(base_J, 0) X(base_k, 0) X(base_c, 0) \
    X(hysteresis, 0) X(hysteresis_length, 1) X(bouc, 0) X(bouc_length, 1) X(bouc_beta, 0.5) \
    X(maxwell, 0) X(maxwell_length, 1) X(softening, 0) X(softening_scale, 1)

#define BLIND_DRIVE(X) \
    X(J_d, 1) X(J_c, 0) X(b_d, 0) X(b_c, 0) X(K_d, 1) X(C_e, 1) X(R, 1) X(L, 1) X(K_t, 0) X(c_t, 0) X(gap, 0) \
    /* initial state */ \
    X(start_angle, 0) X(start_speed, 0) \
    /* motor */ \
    X(m_dry, 0) X(m_asymmetry, 0) X(m_ratio, 1) X(m_speed, 1) \
    X(m_lugre, 0) X(m_lugre_ratio, 1) X(m_lugre_speed, 1) X(m_lugre_stiffness, 1) X(m_lugre_damping, 0) \
    X(cog, 0) X(cog_order, 1) X(cog_phase, 0) X(ripple, 0) X(ripple_order, 1) X(ripple_phase, 0) \
    X(saturation, 0) X(T_rated, 1) X(limit, 1e9) X(dead, 0) X(dead_current, 1) X(warm_K, 0) X(warm_R, 0) X(misread, 0) \
    X(motor_delay, 0) X(motor_ecc, 0) X(motor_ecc_phase, 0) \
    /* gearbox: used with chain = 1 */ \
    X(shaft_k, 0) X(shaft_c, 0) X(shaft_gap, 0) \
    /* pinion and mesh */ \
    X(p_dry, 0) X(p_asymmetry, 0) X(p_ratio, 1) X(p_speed, 1) X(loss, 0) \
    X(p_lugre, 0) X(p_lugre_ratio, 1) X(p_lugre_speed, 1) X(p_lugre_stiffness, 1) X(p_lugre_damping, 0) \
    X(pinion, 0) X(pinion_phase, 0) X(tooth, 0) X(tooth_order, 1) X(tooth_phase, 0) \
    X(breathing, 0) X(breathing_order, 1) X(breathing_phase, 0) X(hertz, 0) X(hertz_scale, 1)
// clang-format on

struct Parameters {
#define X(name, value) double name = value;
    BLIND_COMMON(X)
#undef X
#define X(name, value) PerDrive<double> name = {value, value, value, value};
    BLIND_DRIVE(X)
#undef X

    // Set by name; a drive's number is `name_1` to `name_4`, or `name` for all. An unknown name is refused.
    void set(const std::string& key, double value) {
#define X(name, standard) \
    if (key == #name) {   \
        name = value;     \
        return;           \
    }
        BLIND_COMMON(X)
#undef X
#define X(name, standard)                                     \
    if (key == #name) {                                       \
        name.fill(value);                                     \
        return;                                               \
    }                                                         \
    if (std::size_t n = member(key, #name); n < max_drives) { \
        name[n] = value;                                      \
        return;                                               \
    }
        BLIND_DRIVE(X)
#undef X
        throw std::invalid_argument("unknown parameter " + key);
    }

    std::size_t count() const { return static_cast<std::size_t>(drives); }

  private:
    // Drive that a key such as `K_t_2` speaks of, from 0; max_drives if it is another name's.
    static std::size_t member(const std::string& key, const std::string& name) {
        if (key.size() != name.size() + 2 || key.compare(0, name.size(), name) != 0) return max_drives;
        if (key[name.size()] != '_' || key.back() < '1' || key.back() > '4') return max_drives;
        return static_cast<std::size_t>(key.back() - '1');
    }
};

}  // namespace blind
