// The loop of the impact case by hand: rates and Jacobian with the flanks frozen.
//
// Plant, two speed loops that set the voltages, position loop and torque equaliser; see docs/theory/plant.md. The twists
// x_n = θ_cn − i_m θ_m of the meshes are integrated, not absolute pinion angles.
#pragma once

#include <array>
#include <cmath>

struct Machine {
    double J, b, K_m, K_e, R, L, K_t, gap;  // of each drive, pinion side
    double i_m, J_m, b_m;                   // table
    double K_v, f_v, k_p, k_i, K_E, k_E, T_ten;
    double amplitude, turn;  // of the commanded sine, rad and rad/s
};

namespace state {
enum { omega_c1, omega_c2, x_1, x_2, I_1, I_2, theta_m, omega_m, speed_1, speed_2, equaliser, count };
}

struct Flanks {
    int first = 0, second = 0;  // -1 back, 0 in the gap, 1 front
};

inline double mesh_torque(const Machine& m, int flank, double x) { return flank ? m.K_t * (x - flank * m.gap) : 0.0; }

inline void rates(const Machine& m, Flanks f, double t, const double* y, double* rate) {
    using namespace state;
    const double T_1 = mesh_torque(m, f.first, y[x_1]), T_2 = mesh_torque(m, f.second, y[x_2]);
    const double command = m.amplitude * std::sin(m.turn * t), speed = m.amplitude * m.turn * std::cos(m.turn * t);
    const double set = m.i_m * (m.K_v * (command - y[theta_m]) + m.f_v * speed);
    const double e_T = m.K_m * (y[I_1] - y[I_2]) - m.T_ten;
    const double e_1 = set - y[omega_c1], e_2 = set + m.K_E * e_T + m.k_E * y[equaliser] - y[omega_c2];
    rate[omega_c1] = (m.K_m * y[I_1] - m.b * y[omega_c1] - T_1) / m.J;
    rate[omega_c2] = (m.K_m * y[I_2] - m.b * y[omega_c2] - T_2) / m.J;
    rate[x_1] = y[omega_c1] - m.i_m * y[omega_m];
    rate[x_2] = y[omega_c2] - m.i_m * y[omega_m];
    rate[I_1] = (m.k_p * e_1 + m.k_i * y[speed_1] - m.R * y[I_1] - m.K_e * y[omega_c1]) / m.L;
    rate[I_2] = (m.k_p * e_2 + m.k_i * y[speed_2] - m.R * y[I_2] - m.K_e * y[omega_c2]) / m.L;
    rate[theta_m] = y[omega_m];
    rate[omega_m] = (m.i_m * (T_1 + T_2) - m.b_m * y[omega_m]) / m.J_m;
    rate[speed_1] = e_1;
    rate[speed_2] = e_2;
    rate[equaliser] = e_T;
}

using Matrix = std::array<double, state::count * state::count>;  // by columns

inline Matrix jacobian(const Machine& m, Flanks f) {
    using namespace state;
    Matrix J{};
    const auto at = [&](int row, int column) -> double& { return J[static_cast<std::size_t>(column * count + row)]; };
    const int omega_c[] = {omega_c1, omega_c2}, x[] = {x_1, x_2}, I[] = {I_1, I_2}, integral[] = {speed_1, speed_2};
    const int flank[] = {f.first, f.second};
    for (int n = 0; n < 2; ++n) {
        const double stiffness = flank[n] ? m.K_t : 0.0;
        at(omega_c[n], omega_c[n]) = -m.b / m.J;
        at(omega_c[n], I[n]) = m.K_m / m.J;
        at(omega_c[n], x[n]) = -stiffness / m.J;
        at(omega_m, x[n]) = m.i_m * stiffness / m.J_m;
        at(x[n], omega_c[n]) = 1.0;
        at(x[n], omega_m) = -m.i_m;
        at(integral[n], theta_m) = -m.i_m * m.K_v;
        at(integral[n], omega_c[n]) = -1.0;
    }
    at(speed_2, I_1) = m.K_E * m.K_m;
    at(speed_2, I_2) = -m.K_E * m.K_m;
    at(speed_2, equaliser) = m.k_E;
    for (int n = 0; n < 2; ++n) {
        for (int column = 0; column < count; ++column) at(I[n], column) = m.k_p / m.L * at(integral[n], column);
        at(I[n], integral[n]) += m.k_i / m.L;
        at(I[n], I[n]) -= m.R / m.L;
        at(I[n], omega_c[n]) -= m.K_e / m.L;
    }
    at(theta_m, omega_m) = 1.0;
    at(omega_m, omega_m) = -m.b_m / m.J_m;
    at(equaliser, I_1) = m.K_m;
    at(equaliser, I_2) = -m.K_m;
    return J;
}
