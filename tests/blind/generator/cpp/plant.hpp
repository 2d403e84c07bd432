// Table and two drives: torques from laws, then accelerations.
#pragma once

#include "laws.hpp"
#include "parameters.hpp"
#include "state.hpp"

namespace blind {

// Forces of one instant, before dry friction.
struct Torques {
    PerDrive<double> deflection{}, mesh{}, flank{};
    std::array<double, body_count> net{}, inertia{};
};

class Plant {
  public:
    explicit Plant(const Parameters& p) : p_(p) {}

    // Deflection of mesh n: tooth motion plus what the gears' errors add; its rate, and what a turn of
    // the pinion and of the table adds to it.
    struct Deflection {
        double value, rate, by_pinion, by_table;
    };
    Deflection deflection(std::size_t n, const State& x) const {
        std::size_t body = p_.chain > 0 ? pinion_angle : motor_angle;
        double angle = x[of(n, static_cast<Own>(body))], speed = x[of(n, static_cast<Own>(body + 1))];
        double base = p_.base_J > 0 ? x[extra_angle] : 0, base_speed = p_.base_J > 0 ? x[extra_speed] : 0;
        double ring = x[table_angle] + static_cast<double>(n) * p_.ring_spacing + p_.ring_phase;
        double own = angle + p_.pinion_phase[n], tooth = p_.tooth_order[n] * angle + p_.tooth_phase[n];
        double value = angle - p_.i_m * (x[table_angle] - base) + cowave(p_.ring, ring) + cowave(p_.pinion[n], own) +
                       cowave(p_.tooth[n], tooth);
        double by_pinion = 1 - wave(p_.pinion[n], own) - wave(p_.tooth[n] * p_.tooth_order[n], tooth);
        double by_table = -p_.i_m - wave(p_.ring, ring);
        double rate = by_pinion * speed + by_table * x[table_speed] + p_.i_m * base_speed;
        return {value, rate, by_pinion, by_table};
    }

    double half_gap(std::size_t n, const State& x) const {
        if (p_.wear == 0) return p_.gap[n];
        return p_.gap[n] + p_.wear * worn(x);
    }

    // A bell that closes over the turn (von Mises), 1 at the worst place.
    double worn(const State& x) const {
        return std::exp((std::cos(x[table_angle] - p_.wear_at) - 1) / (p_.wear_width * p_.wear_width));
    }

    Torques torques(double t, const State& x, State& rate) const {
        Torques q;
        double at_table = -p_.b_m * x[table_speed] - load(t, x, rate);
        for (std::size_t n = 0; n < p_.count(); ++n) {
            Pushes own = mesh(n, x, rate, q);
            at_table += own.table;
            drive(t, n, own.pinion, x, rate, q);
        }
        extra(at_table, q, x, rate);
        double angle = p_.inertia_order * x[table_angle] + p_.inertia_phase;
        q.inertia[table_body] = (p_.J_m - (p_.second_J > 0 ? p_.second_J : 0)) * (1 + cowave(p_.inertia, angle));
        q.net[table_body] =
            at_table + p_.J_m * wave(p_.inertia, angle) * p_.inertia_order / 2 * x[table_speed] * x[table_speed];
        return q;
    }

    // Largest dry friction of a body while it slides in direction d.
    double dry(std::size_t body, double d, const State& x, const Torques& q) const {
        double w = x[speed_of(body)];
        if (body == table_body)
            return dry_level(p_.t_dry, p_.t_asymmetry, p_.t_ratio, p_.t_speed, d, w) +
                   p_.t_angle_dry * (1 + std::cos(p_.t_angle_order * x[table_angle] + p_.t_angle_phase));
        std::size_t n = (body - motor_body) % max_drives;
        bool motor = body < pinion_body, pinion = body >= pinion_body || p_.chain == 0;
        double level = 0;
        if (motor) level += p_.i * dry_level(p_.m_dry[n], p_.m_asymmetry[n], p_.m_ratio[n], p_.m_speed[n], d, p_.i * w);
        if (pinion)
            level += dry_level(p_.p_dry[n], p_.p_asymmetry[n], p_.p_ratio[n], p_.p_speed[n], d, w) +
                     p_.loss[n] * std::abs(q.mesh[n]);
        return level;
    }

    bool has_dry(std::size_t body) const {
        if (body == table_body) return p_.t_dry > 0 || p_.t_angle_dry > 0;
        std::size_t n = (body - motor_body) % max_drives;
        bool pinion = p_.p_dry[n] > 0 || p_.loss[n] > 0;
        if (p_.chain == 0) return body < pinion_body && (p_.m_dry[n] > 0 || pinion);
        return body < pinion_body ? p_.m_dry[n] > 0 : pinion;
    }

    // Torque constant with saturation, ripple and temperature.
    double motor_torque(std::size_t n, const State& x) const {
        double I = x[of(n, current)], angle = p_.i * x[of(n, motor_angle)];
        double T = p_.K_d[n] * (1 - p_.warm_K[n]) * I, share = T / p_.T_rated[n];
        return T / std::sqrt(1 + 2 * p_.saturation[n] * share * share) *
               (1 + wave(p_.ripple[n], p_.ripple_order[n] * angle + p_.ripple_phase[n]));
    }

  private:
    // Steady milling between entry and exit of the tool.
    double cut(double t) const {
        double share = ease((t - p_.cut_from) / p_.cut_rise) * ease((p_.cut_to - t) / p_.cut_rise);
        return share * (p_.cut + wave(p_.cut_ripple, 2 * M_PI * p_.cut_frequency * (t - p_.cut_from)));
    }

    // Locked to time, whatever the machine does; at the table, or at motor 1 in its own frame.
    double disturbance(double t) const {
        double hum = wave(p_.hum, 2 * M_PI * (p_.hum_frequency + p_.hum_slope * t / 2) * t + p_.hum_phase);
        return hum + p_.shove * ease((t - p_.shove_at) / p_.shove_rise);
    }

    // What acts against the table's motion, dry friction apart.
    double load(double t, const State& x, State& rate) const {
        double w = x[table_speed], a = x[table_angle], sum = 0;
        if (p_.t_lugre > 0) {
            Lugre l{p_.t_lugre, p_.t_lugre_ratio, p_.t_lugre_speed, p_.t_lugre_stiffness, p_.t_lugre_damping};
            rate[table_bristle] = l.rate(x[table_bristle], w);
            sum += l.friction(x[table_bristle], w);
        }
        sum += p_.drag * w * std::abs(w) + p_.cubic * w * w * w - cowave(p_.unbalance, a + p_.unbalance_phase);
        sum += hysteresis(x, rate);
        if (p_.cut_to > p_.cut_from) sum += cut(t);
        if (p_.disturbed == 0) sum += disturbance(t);
        if (p_.spot != 0) {
            double u = (a - p_.spot_at) / p_.spot_width;
            sum += p_.spot * u * std::exp((1 - u * u) / 2);
        }
        return sum;
    }

    // Friction with memory at the table: Bouc-Wen, and Maxwell's slip elements of one stiffness and rising limits.
    double hysteresis(const State& x, State& rate) const {
        double w = x[table_speed], sum = 0;
        if (p_.bouc > 0) {
            double z = x[table_hysteresis];
            rate[table_hysteresis] =
                (w - p_.bouc_beta * std::abs(w) * std::abs(z) * z - (1 - p_.bouc_beta) * w * z * z) / p_.bouc_length;
            sum += p_.bouc * z;
        }
        for (std::size_t k = 0; k < 4 && p_.maxwell > 0; ++k) {
            double z = x[maxwell_1 + k], limit = p_.maxwell_length * static_cast<double>(1 << k) / 8;
            bool slips = std::abs(z) >= limit && z * w > 0;
            rate[maxwell_1 + k] = slips ? 0 : w;
            sum += p_.maxwell / p_.maxwell_length * 8 / 15 * clamp(z, limit);
        }
        return sum;
    }

    // Torques of mesh n on both wheels: its energy by their angles.
    struct Pushes {
        double pinion, table;
    };
    Pushes mesh(std::size_t n, const State& x, State& rate, Torques& q) const {
        auto [value, speed, by_pinion, by_table] = deflection(n, x);
        double beyond = dead_zone(value, half_gap(n, x));
        double angle = x[of(n, p_.chain > 0 ? pinion_angle : motor_angle)];
        double K = p_.K_t[n] * (1 + cowave(p_.breathing[n], p_.breathing_order[n] * angle + p_.breathing_phase[n]));
        if (p_.hertz[n] > 0) K *= 1 + p_.hertz[n] * std::sqrt(std::abs(beyond) / p_.hertz_scale[n]);
        if (p_.softening > 0) K /= 1 + p_.softening * std::abs(beyond) / p_.softening_scale;
        q.deflection[n] = value;
        q.flank[n] = sign(beyond);
        q.mesh[n] = contact(K * beyond, p_.c_t[n] * speed, beyond);
        if (p_.hysteresis > 0) {  // Dahl element across the mesh
            double z = x[of(n, flank_state)];
            rate[of(n, flank_state)] = (speed - std::abs(speed) * z) / p_.hysteresis_length;
            q.mesh[n] += p_.hysteresis * z;
        }
        Pushes own{-q.mesh[n] * by_pinion, -q.mesh[n] * by_table};
        if (p_.breathing[n] != 0) {  // teeth that grow stiffer push along, whatever the angle moves
            double swing = wave(p_.breathing[n], p_.breathing_order[n] * angle + p_.breathing_phase[n]);
            own.pinion += p_.K_t[n] * p_.breathing_order[n] * swing * beyond * beyond / 2;
        }
        if (p_.wear != 0) {
            double slope = -p_.wear * worn(x) * std::sin(x[table_angle] - p_.wear_at) / (p_.wear_width * p_.wear_width);
            own.table += q.mesh[n] * sign(beyond) * slope;
        }
        return own;
    }

    void drive(double t, std::size_t n, double push, const State& x, State& rate, Torques& q) const {
        double w = x[of(n, motor_speed)], angle = p_.i * x[of(n, motor_angle)];
        double cog = wave(p_.cog[n], p_.cog_order[n] * angle + p_.cog_phase[n]);
        double motor = p_.i * (motor_torque(n, x) + cog - p_.i * p_.b_d[n] * w);
        if (p_.disturbed > 0 && n == 0) motor -= p_.i * disturbance(t);
        if (p_.m_lugre[n] > 0) {
            Lugre l{p_.m_lugre[n], p_.m_lugre_ratio[n], p_.m_lugre_speed[n], p_.m_lugre_stiffness[n],
                    p_.m_lugre_damping[n]};
            rate[of(n, motor_bristle)] = l.rate(x[of(n, motor_bristle)], p_.i * w);
            motor -= p_.i * l.friction(x[of(n, motor_bristle)], p_.i * w);
        }
        double v = p_.chain > 0 ? x[of(n, pinion_speed)] : w;
        double pinion = push - p_.b_c[n] * v;
        if (p_.p_lugre[n] > 0) {
            Lugre l{p_.p_lugre[n], p_.p_lugre_ratio[n], p_.p_lugre_speed[n], p_.p_lugre_stiffness[n],
                    p_.p_lugre_damping[n]};
            rate[of(n, pinion_bristle)] = l.rate(x[of(n, pinion_bristle)], v);
            pinion -= l.friction(x[of(n, pinion_bristle)], v);
        }
        double J_motor = p_.i * p_.i * p_.J_d[n];
        if (p_.chain == 0) {
            q.net[motor_body + n] = motor + pinion;
            q.inertia[motor_body + n] = J_motor + p_.J_c[n];
            return;
        }
        double twist = x[of(n, motor_angle)] - x[of(n, pinion_angle)];
        double beyond = dead_zone(twist, p_.shaft_gap[n]);
        double damping = p_.shaft_c[n] * (w - v);
        double shaft =
            p_.shaft_gap[n] > 0 ? contact(p_.shaft_k[n] * beyond, damping, beyond) : p_.shaft_k[n] * twist + damping;
        q.net[motor_body + n] = motor - shaft;
        q.inertia[motor_body + n] = J_motor;
        q.net[pinion_body + n] = pinion + shaft;
        q.inertia[pinion_body + n] = p_.J_c[n];
    }

    // A second mass on the table, or the foundation that carries the motors.
    void extra(double& at_table, const Torques& q, const State& x, State& rate) const {
        if (p_.second_J > 0) {
            double pull =
                p_.second_k * (x[table_angle] - x[extra_angle]) + p_.second_c * (x[table_speed] - x[extra_speed]);
            at_table -= pull;
            rate[extra_speed] = pull / p_.second_J;
        } else if (p_.base_J > 0) {
            double reaction = 0;
            for (double torque : q.mesh) reaction -= p_.i_m * torque;
            rate[extra_speed] = (reaction - p_.base_k * x[extra_angle] - p_.base_c * x[extra_speed]) / p_.base_J;
        } else {
            return;
        }
        rate[extra_angle] = x[extra_speed];
    }

    const Parameters& p_;
};

}  // namespace blind
