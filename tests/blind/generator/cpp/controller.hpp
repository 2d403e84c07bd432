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
    std::array<double, 2> speed, current;
};

// Outputs that a sampled loop holds between its ticks.
struct Held {
    double position = 0, tension = 0;
    std::array<double, 2> torque = {0, 0};
};

class Controller {
  public:
    explicit Controller(const Parameters& p) : p_(p), lag_(p.delta_t, p.step, 0), late_(p.command_delay, p.step, 0) {}

    // Voltages, and the rates of the controller's own states; `part` of the step gone by.
    std::array<double, 2> act(const Command& c, const Readings& r, const State& x, double part, State& rate) {
        double now = p_.position_sample > 0 ? held_.position : position(c, r);
        double master = late_.on() ? late_.at(part) : now;
        double slave = lag_.on() ? lag_.at(part) : master;
        double y = p_.tension_sample > 0 ? held_.tension : correction(r, x, rate);
        rate[tension] = p_.tau_t > 0 ? (p_.T_ten - x[tension]) / p_.tau_t : 0;
        std::array<double, 2> wanted = {master - y, slave + y}, voltage{};
        for (std::size_t n = 0; n < 2; ++n) {
            double torque = p_.speed_sample > 0 ? held_.torque[n] : speed(n, wanted[n] - r.speed[n], x, rate);
            voltage[n] = current_loop(n, torque, r, x, rate);
        }
        return voltage;
    }

    // Once at the start of every step: samplers that are due, signals that are delayed later.
    void begin_step(std::size_t k, const Command& c, const Readings& r, State& x) {
        if (due(k, p_.position_sample)) held_.position = position(c, r);
        double master = p_.position_sample > 0 ? held_.position : position(c, r);
        late_.push(master);
        if (late_.on()) master = late_.at(0);
        lag_.push(master);
        double slave = lag_.on() ? lag_.at(0) : master;
        if (due(k, p_.tension_sample)) {
            State rate{};
            held_.tension = correction(r, x, rate);
            x[equaliser] += p_.tension_sample * rate[equaliser];
        }
        if (!due(k, p_.speed_sample)) return;
        State rate{};
        double y = p_.tension_sample > 0 ? held_.tension : correction(r, x, rate);
        for (std::size_t n = 0; n < 2; ++n) {
            held_.torque[n] = speed(n, (n == 0 ? master - y : slave + y) - r.speed[n], x, rate);
            x[of(n, speed_integral)] += p_.speed_sample * rate[of(n, speed_integral)];
        }
    }

  private:
    bool due(std::size_t k, double sample) const {
        return sample > 0 && k % static_cast<std::size_t>(std::lround(sample / p_.step)) == 0;
    }

    // Speed set-point of the pinions.
    double position(const Command& c, const Readings& r) const {
        return clamp(p_.i_m * (p_.K_v * (c.angle - r.table) + p_.f_v * c.speed), p_.Omega_max);
    }

    // The equaliser's speed correction.
    double correction(const Readings& r, const State& x, State& rate) const {
        double filtered = p_.tau_t > 0 ? x[tension] : p_.T_ten;
        double T_1 = p_.K_d[0] * r.current[0] * (1 + p_.misread[0]),
               T_2 = p_.K_d[1] * r.current[1] * (1 + p_.misread[1]);
        double error = 2 * (p_.w * T_1 - (1 - p_.w) * T_2) - filtered;
        double raw = p_.K_E * (error + x[equaliser]);
        bool outward = std::abs(raw) >= p_.Omega_E && raw * error > 0;
        rate[equaliser] = p_.T_E > 0 && !outward ? error / p_.T_E : 0;
        return clamp(raw, p_.Omega_E);
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
        rate[of(n, current_integral)] = std::abs(raw) < p_.U_max ? error : 0;
        return clamp(raw, p_.U_max);
    }

    const Parameters& p_;
    Held held_;
    Delay lag_, late_;
};

}  // namespace blind
