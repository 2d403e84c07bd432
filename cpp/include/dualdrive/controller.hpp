// The master/slave controller: position loop, tension with torque equaliser, speed loops, current loops.
//
// Speeds (Ω, ω, y) are pinion speeds; T̂, T*, T_ten, T_max are motor torques; k_p is pinion torque per pinion
// speed. Each loop is a limited PI block: continuous by default, as in the paper, or sampled with zero-order
// hold and a computing latency. The laws below are the only description: the continuous flow and the tick of a
// sampled loop both call them.
#pragma once

#include <string>

#include "dualdrive/parameter.hpp"
#include "dualdrive/scalar.hpp"

namespace dualdrive {

template <class S>
struct Controller {
    S K_v, K_i, K_d, tau_d, f_v;  // position loop
    S tau_s;                      // position sensors
    S k_p, T_N;                   // speed loops
    S g_E, T_E, Omega_E, w;       // torque equaliser
    S T_ten, tau_t, T_off;        // tension
    S delta_c, delta_t;           // command lag, slave lag
    S omega_ci;                   // current loops
    S position_sample, position_latency, tension_sample, tension_latency;
    S speed_sample, speed_latency, current_sample, current_latency;

    static constexpr auto parameters() {
        using C = Controller;
        constexpr const char* clock = "sample time; 0 = continuous";
        constexpr const char* latency = "computing delay from sample to output";
        return fields<C, S>({
            {&C::K_v, {"K_v", "1/s", non_negative, 5.0, 5.0, "position gain"}},
            {&C::K_i, {"K_i", "1/s^2", non_negative, 0.0, 1.0, "integral gain of the position loop"}},
            {&C::K_d, {"K_d", "", non_negative, 0.0, 1.0, "derivative gain of the position loop"}},
            {&C::tau_d, {"tau_d", "s", positive, 0.02, 0.02, "filter time of the derivative"}},
            {&C::f_v, {"f_v", "", non_negative, 1.0, 1.0, "speed feed-forward weight"}},
            {&C::tau_s,
             {"tau_s", "s", positive, 0.1, 0.1,
              "time in which the position reading goes over from motor to table, with both sensors"}},
            {&C::k_p, {"k_p", "N*m*s/rad", positive, 1.0, 1.0, "speed gain: pinion torque per pinion speed"}},
            {&C::T_N, {"T_N", "s", non_negative, 0.0, 0.1, "integral time of the speed loop; 0 = off"}},
            {&C::g_E, {"g_E", "", non_negative, 0.5, 0.5, "equaliser gain as a loop-gain number, 2 K_E k_p / i"}},
            {&C::T_E, {"T_E", "s", non_negative, 0.0, 0.1, "integral time of the torque equaliser; 0 = off"}},
            {&C::Omega_E, {"Omega_E", "rad/s", positive, infinity, 0.1, "limit of the equaliser's speed correction"}},
            {&C::w, {"w", "", fraction, 0.5, 0.5, "torque weight of the master; 0.5 shares equally"}},
            {&C::T_ten, {"T_ten", "N*m", any, 0.0, 60.0, "tension: wanted torque difference T_1 - T_2 at the motors"}},
            {&C::tau_t, {"tau_t", "s", non_negative, 0.0, 0.1, "tension filter; 0 = none"}},
            {&C::T_off,
             {"T_off", "N*m", positive, infinity, 100.0, "torque sum at which a falling tension reaches zero"}},
            {&C::delta_c,
             {"delta_c", "s", non_negative, 0.0, 0.005,
              "command lag: every drive gets the speed set-point of the position loop this much later"}},
            {&C::delta_t,
             {"delta_t", "s", non_negative, 0.0, 0.01,
              "slave lag: the slave gets the master's speed set-point this much later"}},
            {&C::omega_ci, {"omega_ci", "1/s", positive, 1000.0, 1000.0, "bandwidth of the current loop"}},
            {&C::position_sample, {"position_sample", "s", non_negative, 0.0, 1e-3, clock}},
            {&C::position_latency, {"position_latency", "s", non_negative, 0.0, 1e-3, latency}},
            {&C::tension_sample, {"tension_sample", "s", non_negative, 0.0, 1e-3, clock}},
            {&C::tension_latency, {"tension_latency", "s", non_negative, 0.0, 1e-3, latency}},
            {&C::speed_sample, {"speed_sample", "s", non_negative, 0.0, 1e-3, clock}},
            {&C::speed_latency, {"speed_latency", "s", non_negative, 0.0, 1e-3, latency}},
            {&C::current_sample, {"current_sample", "s", non_negative, 0.0, 1e-4, clock}},
            {&C::current_latency, {"current_latency", "s", non_negative, 0.0, 1e-4, latency}},
        });
    }

    // Eq. C4: K_E = g_E i / (2 k_p): the gain as a loop-gain number, rescaled with the speed loop's.
    S equaliser_gain(const S& i) const { return g_E * i / (2.0 * k_p); }
};

// Structure of the controller: what is a choice, not a number.
struct ControllerOptions {
    enum class Kind { none, master_slave } kind = Kind::none;
    enum class Target { both, slave, master } equaliser = Target::both;  // MD37254: who gets the correction
    enum class Schedule { constant, falling, off } tension = Schedule::constant;
    enum class CurrentLoop { cascade, voltage } current = CurrentLoop::cascade;
    int speed_samples = 0;  // 0: the motor's true speed; n: mean of the last n encoder samples, differenced
    // Which angle the position loop is closed on: the table's encoder, the master motor's, or both (Eq. C1).
    enum class PositionSensor { table, motor, both } position_sensor = PositionSensor::table;
};

// Eq. C0: out = sat[ proportional + gain · x, limit ], ẋ = integrand; x stands still while out is at its limit and the
// integrand would drive it further out (conditional integration, the anti-windup of every loop below).
template <class S>
struct Block {
    S proportional{}, gain{}, integrand{}, limit{};
    S raw{}, out{};
};

// Eq. C1: θ_s = θ_m with the table's encoder; θ_1/(i i_m) with the master motor's; with both θ_1/(i i_m) + d,
// τ_s ḋ = θ_m − θ_1/(i i_m) − d: the motor's at once, the table's in the long run.
template <class S>
S sensor_difference_rate(const Controller<S>& c, const S& table, const S& motor, const S& difference) {
    return (table - motor - difference) / c.tau_s;
}

// Eq. C2: Ω_1 = sat( i_m [K_v e + K_i x_p + K_d ė_f + f_v θ̇_ref], Ω_max ),  e = θ_ref − θ_s,  ė_f = (e − z)/τ_d, ż = ė_f,
// ẋ_p = e,  Ω_max = ω_max/i of the master
template <class S>
Block<S> position_loop(const Controller<S>& c, const S& i_m, const S& omega_limit, const S& e, const S& omega_ref,
                       const S& z) {
    const S e_rate = (e - z) / c.tau_d;
    return {i_m * (c.K_v * e + c.K_d * e_rate + c.f_v * omega_ref), i_m * c.K_i, e, omega_limit, {}, {}};
}

// Eq. C3: y = sat[ K_E (e_T + x_e), Ω_E ],  e_T = 2 [w T̂_1 − (1 − w) T̂_2] − T_t,  ẋ_e = e_T / T_E,  τ_t Ṫ_t = T_ten − T_t
template <class S>
Block<S> torque_equaliser(const Controller<S>& c, const S& i, const S& T_master, const S& T_slave, const S& tension) {
    const S e = 2.0 * (c.w * T_master - (1.0 - c.w) * T_slave) - tension;
    const S gain = c.equaliser_gain(i);
    if (value_of(c.T_E) == 0.0) return {gain * e, S(0.0), S(0.0), c.Omega_E, {}, {}};
    return {gain * e, gain, e / c.T_E, c.Omega_E, {}, {}};
}

// Eq. C5: T* = sat[ (k_p/i)(ε + x_s), T_max ],  ε = Ω* − ω_c,  ẋ_s = ε / T_N,  Ω_1* = Ω_1 − y,  Ω_2* = Ω_1(t − δt) + y
template <class S>
Block<S> speed_loop(const Controller<S>& c, const S& i, const S& T_max, const S& error) {
    const S gain = c.k_p / i;
    if (value_of(c.T_N) == 0.0) return {gain * error, S(0.0), S(0.0), T_max, {}, {}};
    return {gain * error, gain, error / c.T_N, T_max, {}, {}};
}

// Eq. C6: T_f/T* = [ (s/ω_Z)² + 2 D_Z s/ω_Z + 1 ] / [ (s/ω_N)² + 2 D_N s/ω_N + 1 ]: the torque set-point behind the speed
// loop and its limit goes through one second-order filter per drive; without ω_Z the numerator is 1, a low-pass, with
// ω_Z = ω_N and D_Z < D_N it is a notch. States x with x_1'' /ω_N² + 2 D_N x_1'/ω_N + x_1 = T*, x_2 = x_1'/ω_N.
// Source: Siemens, SINAMICS S120 Function Manual FH1, current set-point filter (general second-order filter, band-stop).
// A drive runs it in the clock of its current loop; here it is continuous, whatever else is sampled.
template <class S>
struct SetPointFilter {
    S pole{}, pole_damping{}, zero{}, zero_damping{};  // rad/s; zero = 0: none
    bool low_pass = true;

    template <class MotorData>
    explicit SetPointFilter(const MotorData& m)
        : pole(6.283185307179586 * m.filter_pole),
          pole_damping(m.filter_pole_damping),
          zero(6.283185307179586 * m.filter_zero),
          zero_damping(m.filter_zero_damping),
          low_pass(value_of(m.filter_zero) == 0.0) {}

    S bend(const S& in, const S* x) const { return in - x[0] - 2.0 * pole_damping * x[1]; }  // x_1''/ω_N²
    S output(const S& in, const S* x) const {
        if (low_pass) return x[0];
        const S ratio = pole / zero;
        return x[0] + ratio * (2.0 * zero_damping * x[1] + ratio * bend(in, x));
    }
    void flow(const S& in, const S* x, S* rate) const {
        rate[0] = pole * x[1];
        rate[1] = pole * bend(in, x);
    }
};

// Eq. C7: U = sat[ ω_ci L (I* − I) + ω_ci R ∫(I* − I) + C_e ω, U_max ],  I* = T_f/K_d
template <class S, class MotorData>
Block<S> current_loop(const Controller<S>& c, const MotorData& m, const S& T_ref, const S& current, const S& speed) {
    const S e = T_ref / m.K_d - current;
    return {c.omega_ci * m.L * e + m.C_e * speed, c.omega_ci * m.R, e, m.U_max, {}, {}};
}

// Eq. C8: U = sat[ R T_f/K_d, U_max ]: a drive without a current loop, its set-point a voltage through the resistance alone.
template <class S, class MotorData>
Block<S> voltage_drive(const MotorData& m, const S& T_ref) {
    return {m.R / m.K_d * T_ref, S(0.0), S(0.0), m.U_max, {}, {}};
}

}  // namespace dualdrive
