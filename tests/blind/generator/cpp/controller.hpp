// Master/slave controller with torque equaliser; each loop continuous, or sampled and held.
#pragma once

#include "delay.hpp"
#include "laws.hpp"
#include "parameters.hpp"
#include "reference.hpp"
#include "state.hpp"

namespace blind {

// What the drive measures: table angle, speeds in the pinion's frame, currents.
struct Readings {
    double table;
    PerDrive<double> speed, current;
};

// Outputs that a sampled loop holds between its ticks.
struct Held {
    double position = 0;
    PerDrive<double> tension{}, torque{};
};

class Controller {
  public:
    explicit Controller(const Parameters& p)
        : p_(p),
          lag_(p.delta_t, p.step, 0, p.position_sample > 0),
          late_(p.command_delay, p.step, 0, p.position_sample > 0) {}

    // Voltages, and the rates of the controller's own states; `part` of the step gone by.
    PerDrive<double> act(const Command& c, const Readings& r, const State& x, double part, State& rate) {
        double now = p_.position_sample > 0 ? held_.position : position(c, r, x, rate);
        double master = late_.on() ? late_.at(part) : now;
        double slave = lag_.on() ? lag_.at(part) : master;
        PerDrive<double> y = p_.tension_sample > 0 ? held_.tension : corrections(r, x, rate);
        PerDrive<double> wanted = set_points(master, slave, y), voltage{};
        for (std::size_t n = 0; n < p_.count(); ++n) {
            double torque = p_.speed_sample > 0 ? held_.torque[n] : speed(n, wanted[n] - r.speed[n], x, rate);
            voltage[n] = current_loop(n, torque, r, x, rate);
        }
        return voltage;
    }

    // Once at the start of every step: samplers that are due, signals that are delayed later. Integrators and
    // filters of a sampled loop step with its clock, by forward Euler.
    void begin_step(std::size_t k, const Command& c, const Readings& r, State& x) {
        State rate{};
        if (due(k, p_.position_sample)) {
            held_.position = position(c, r, x, rate);
            x[position_integral] += p_.position_sample * rate[position_integral];
            x[derivative_filter] += p_.position_sample * rate[derivative_filter];
        }
        double master = p_.position_sample > 0 ? held_.position : position(c, r, x, rate);
        late_.push(master);
        if (late_.on()) master = late_.at(0);
        lag_.push(master);
        double slave = lag_.on() ? lag_.at(0) : master;
        PerDrive<double> y = p_.tension_sample > 0 ? held_.tension : corrections(r, x, rate);
        if (due(k, p_.tension_sample)) {
            held_.tension = y = corrections(r, x, rate);
            x[tension] += p_.tension_sample * rate[tension];
            for (std::size_t n = 1; n < p_.count(); ++n)
                x[of(n, equaliser)] += p_.tension_sample * rate[of(n, equaliser)];
        }
        if (!due(k, p_.speed_sample)) return;
        PerDrive<double> wanted = set_points(master, slave, y);
        for (std::size_t n = 0; n < p_.count(); ++n) {
            held_.torque[n] = speed(n, wanted[n] - r.speed[n], x, rate);
            x[of(n, speed_integral)] += p_.speed_sample * rate[of(n, speed_integral)];
        }
    }

  private:
    bool due(std::size_t k, double sample) const {
        return sample > 0 && k % static_cast<std::size_t>(std::lround(sample / p_.step)) == 0;
    }

    // Speed set-point of the pinions.
    double position(const Command& c, const Readings& r, const State& x, State& rate) const {
        double e = c.angle - r.table, e_rate = 0;
        if (p_.K_d_position > 0) rate[derivative_filter] = e_rate = (e - x[derivative_filter]) / p_.tau_d;
        double raw =
            p_.i_m * (p_.K_v * e + p_.K_i * x[position_integral] + p_.K_d_position * e_rate + p_.f_v * c.speed);
        bool outward = std::abs(raw) >= p_.Omega_max && raw * e > 0;
        rate[position_integral] = p_.K_i > 0 && !outward ? e : 0;
        return clamp(raw, p_.Omega_max);
    }

    // The equaliser's speed correction of each slave, held against the master.
    PerDrive<double> corrections(const Readings& r, const State& x, State& rate) const {
        PerDrive<double> y{};
        double filtered = p_.tau_t > 0 ? x[tension] : p_.T_ten;
        rate[tension] = p_.tau_t > 0 ? (p_.T_ten - x[tension]) / p_.tau_t : 0;
        for (std::size_t n = 1; n < p_.count(); ++n) {
            double error = 2 * (p_.w * told(0, r) - (1 - p_.w) * told(n, r)) - filtered;
            double raw = p_.K_E * (error + x[of(n, equaliser)]);
            bool outward = std::abs(raw) >= p_.Omega_E && raw * error > 0;
            rate[of(n, equaliser)] = p_.T_E > 0 && !outward ? error / p_.T_E : 0;
            y[n] = clamp(raw, p_.Omega_E);
        }
        return y;
    }

    double told(std::size_t n, const Readings& r) const { return p_.K_d[n] * r.current[n] * (1 + p_.misread[n]); }

    // The slaves get their own correction, the master the mean of all the other way.
    PerDrive<double> set_points(double master, double slave, const PerDrive<double>& y) const {
        PerDrive<double> wanted{master};
        for (std::size_t n = 1; n < p_.count(); ++n) {
            wanted[n] = slave + p_.to_slaves * y[n];
            wanted[0] -= p_.to_master * y[n] / static_cast<double>(p_.count() - 1);
        }
        return wanted;
    }

    // Motor torque set-point.
    double speed(std::size_t n, double error, const State& x, State& rate) const {
        double raw = p_.k_p / p_.i * (error + x[of(n, speed_integral)]);
        bool outward = std::abs(raw) >= p_.T_max && raw * error > 0;
        rate[of(n, speed_integral)] = p_.T_N > 0 && !outward ? error / p_.T_N : 0;
        return clamp(raw, p_.T_max);
    }

    // Its compensation of the induced voltage knows the true speed, as the design has it (K_e ω_c).
    double current_loop(std::size_t n, double torque, const Readings& r, const State& x, State& rate) const {
        double error = clamp(torque / p_.K_d[n], p_.limit[n]) - r.current[n];
        double induced = p_.i * p_.C_e[n] * x[of(n, motor_speed)];
        double raw = p_.omega_ci * (p_.L[n] * error + p_.R[n] * x[of(n, current_integral)]) + induced;
        bool outward = std::abs(raw) >= p_.U_max && raw * error > 0;
        rate[of(n, current_integral)] = outward ? 0 : error;
        return clamp(raw, p_.U_max);
    }

    const Parameters& p_;
    Held held_;
    Delay lag_, late_;
};

}  // namespace blind
