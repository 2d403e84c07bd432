// Fixed steps of fourth-order Runge-Kutta; dry friction sticks and slips between steps (Karnopp 1985).
#pragma once

#include <array>
#include <vector>

#include "controller.hpp"
#include "plant.hpp"

namespace blind {

class Simulation {
  public:
    Simulation(const Parameters& p, const Reference& reference)
        : p_(p), reference_(reference), plant_(p), controller_(p), late_table_(p.table_delay, p.step, 0) {
        for (std::size_t n = 0; n < max_drives; ++n) {
            late_motor_.emplace_back(p.motor_delay[n], p.step, 0);
            late_angle_.emplace_back(p.motor_delay[n], p.step, 0);
        }
        for (std::size_t n = 0; n < p_.count(); ++n) {
            x_[of(n, motor_angle)] = x_[of(n, pinion_angle)] = p.start_angle[n];
            x_[of(n, motor_speed)] = x_[of(n, pinion_speed)] = p.start_speed[n];
        }
        State rate{};
        Torques q = plant_.torques(p.begin, x_, rate);
        for (std::size_t body = 0; body < body_count; ++body)
            sliding_[body] = plant_.has_dry(body) ? static_cast<int>(sign(x_[speed_of(body)])) : nothing;
        release(q);
    }

    double time() const { return p_.begin + static_cast<double>(k_) * p_.step; }
    const State& state() const { return x_; }
    const Plant& plant() const { return plant_; }

    // Remember the start of this step: delayed readings, samplers.
    void begin_step() {
        late_table_.push(table_reading());
        for (std::size_t n = 0; n < p_.count(); ++n) {
            late_motor_[n].push(speed_reading(n, x_));
            late_angle_[n].push(angle_reading(n));
        }
        if (p_.open == 0) controller_.begin_step(k_, reference_.at(time()), readings(x_, 0), x_);
    }

    // A step in which a flank is met or left, or a body sticks or slips, is done again in short ones.
    void step() {
        State before = x_;
        Sliding slid = sliding_;
        advance(0, 1);
        if (sliding_ != slid || flanks(x_) != flanks(before)) {
            x_ = before, sliding_ = slid;
            for (int j = 0; j < short_steps; ++j) advance(static_cast<double>(j) / short_steps, 1.0 / short_steps);
        }
        ++k_;
    }

    // What the drive's own sensors say now.
    double table_shown() const { return late_table_.on() ? late_table_.at(0) : table_reading(); }
    double motor_shown(std::size_t n) const { return late_angle_[n].on() ? late_angle_[n].at(0) : angle_reading(n); }

  private:
    static constexpr int short_steps = 32;

    double table_reading() const { return table_reading(x_); }
    double table_reading(const State& x) const {
        double base = p_.base_J > 0 ? x[extra_angle] : 0;
        return x[table_angle] - base + cowave(p_.table_ecc, x[table_angle] + p_.table_ecc_phase);
    }
    double angle_reading(std::size_t n) const {
        double angle = p_.i * x_[of(n, motor_angle)];
        return angle + cowave(p_.motor_ecc[n], angle + p_.motor_ecc_phase[n]);
    }
    double speed_reading(std::size_t n, const State& x) const {
        double angle = p_.i * x[of(n, motor_angle)];
        return x[of(n, motor_speed)] * (1 - wave(p_.motor_ecc[n], angle + p_.motor_ecc_phase[n]));
    }

    Readings readings(const State& x, double part) const {
        Readings r{late_table_.on() ? late_table_.at(part) : table_reading(x), {}, {}};
        for (std::size_t n = 0; n < p_.count(); ++n) {
            r.speed[n] = late_motor_[n].on() ? late_motor_[n].at(part) : speed_reading(n, x);
            r.current[n] = x[of(n, current)];
        }
        return r;
    }

    // By a part of a step, `from` which part of it on.
    void advance(double from, double part) {
        double h = part * p_.step;
        State a = slope(x_, from), b = slope(moved(a, h / 2), from + part / 2),
              c = slope(moved(b, h / 2), from + part / 2), d = slope(moved(c, h), from + part);
        for (std::size_t i = 0; i < active_; ++i) x_[i] += h / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]);
        catch_and_release(time() + (from + part) * p_.step);
    }

    // Which flank carries, of every play.
    std::array<double, 2 * max_drives> flanks(const State& x) const {
        std::array<double, 2 * max_drives> made{};
        for (std::size_t n = 0; n < p_.count(); ++n) {
            made[n] = sign(dead_zone(plant_.deflection(n, x).value, plant_.half_gap(n, x)));
            double twist = x[of(n, motor_angle)] - x[of(n, pinion_angle)];
            if (p_.shaft_gap[n] > 0) made[max_drives + n] = sign(dead_zone(twist, p_.shaft_gap[n]));
        }
        return made;
    }

    State moved(const State& rate, double h) const {
        State x{};
        for (std::size_t i = 0; i < active_; ++i) x[i] = x_[i] + h * rate[i];
        return x;
    }

    State slope(const State& x, double part) {
        State rate{};
        double t = time() + part * p_.step;
        PerDrive<double> U{};
        if (p_.open == 0) U = controller_.act(reference_.at(t), readings(x, part), x, part, rate);
        Torques q = plant_.torques(t, x, rate);
        rate[table_angle] = x[table_speed];
        for (std::size_t n = 0; n < p_.count(); ++n) {
            rate[of(n, motor_angle)] = x[of(n, motor_speed)];
            rate[of(n, pinion_angle)] = x[of(n, pinion_speed)];
            rate[of(n, current)] = p_.open > 0 ? 0 : armature(n, x, U[n]);
        }
        for (std::size_t body = 0; body < body_count; ++body) rate[speed_of(body)] = acceleration(body, x, q);
        return rate;
    }

    double armature(std::size_t n, const State& x, double U) const {
        double I = x[of(n, current)];
        double lost = p_.dead[n] > 0 ? p_.dead[n] * std::tanh(I / p_.dead_current[n]) : 0;
        double R = p_.R[n] * (1 + p_.warm_R[n]), C_e = p_.C_e[n] * (1 - p_.warm_K[n]);
        return (U - lost - R * I - C_e * p_.i * x[of(n, motor_speed)]) / p_.L[n];
    }

    double acceleration(std::size_t body, const State& x, const Torques& q) const {
        if (q.inertia[body] == 0 || sliding_[body] == 0) return 0;
        double d = sliding_[body];
        double friction = sliding_[body] == nothing ? 0 : d * plant_.dry(body, d, x, q);
        return (q.net[body] - friction) / q.inertia[body];
    }

    // A body whose speed changed sign is caught; whoever is stuck and pulled too hard slides.
    void catch_and_release(double t) {
        bool any = false;
        for (std::size_t body = 0; body < body_count; ++body) {
            if (sliding_[body] == nothing) continue;
            any = true;
            double& w = x_[speed_of(body)];
            if (w * sliding_[body] < 0) sliding_[body] = 0, w = 0;
        }
        if (!any) return;
        State rate{};
        release(plant_.torques(t, x_, rate));
    }

    void release(const Torques& q) {
        for (std::size_t body = 0; body < body_count; ++body) {
            if (sliding_[body] != 0) continue;
            double pull = q.net[body];
            if (std::abs(pull) > plant_.dry(body, sign(pull), x_, q)) sliding_[body] = static_cast<int>(sign(pull));
        }
    }

    const Parameters& p_;
    std::size_t active_ = of(p_.count(), motor_angle);  // states in use
    const Reference& reference_;
    Plant plant_;
    Controller controller_;
    Delay late_table_;
    std::vector<Delay> late_motor_, late_angle_;
    State x_{};
    Sliding sliding_{};
    std::size_t k_ = 0;
};

}  // namespace blind
