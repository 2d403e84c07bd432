// Two drives pull against each other on one ring: a move of the table, its following error, and which flanks carried.
#include <dualdrive/motion.hpp>
#include <dualdrive/simulate.hpp>
#include <dualdrive/version.hpp>

#include <algorithm>
#include <cmath>
#include <iostream>

using namespace dualdrive;

namespace {

// Motor - reducer - pinion - mesh with play - table, twice: Eq. 22 of the source paper.
Machine dual_servo() {
    Machine m;
    for (const char* n : {"1", "2"})
        for (const char* part : {"motor_", "pinion_"}) m.add_body(std::string(part) + n);
    m.add_body("table");
    for (const std::string n : {"1", "2"}) {
        m.connect("gearbox_" + n, "motor_" + n, "pinion_" + n, ConnectionKind::rigid, TwistFrame::driven);
        m.connect("mesh_" + n, "pinion_" + n, "table", ConnectionKind::gap, TwistFrame::driver);
    }
    for (const std::string n : {"1", "2"}) m.add_motor("motor_" + n, "motor_" + n, MotorKind::armature);
    m.set_controller({.kind = ControllerOptions::Kind::master_slave});
    m.add_effect("mesh_damping", "meshes");
    const std::pair<const char*, double> numbers[] = {{"motors.J", 0.045},     {"motors.b", 0.02},
                                                      {"motors.K_d", 1.155},   {"motors.C_e", 1.155},
                                                      {"motors.R", 0.15},      {"motors.L", 3e-3},
                                                      {"motors.T_max", 200},   {"gearboxes.ratio", 150},
                                                      {"pinions.J", 60},       {"pinions.b", 200},
                                                      {"meshes.ratio", 20},    {"meshes.stiffness", 2e7},
                                                      {"meshes.gap", 1.1e-3},  {"table.J", 4.95e6},
                                                      {"table.b", 1e5},        {"mesh_damping@meshes.coefficient", 2e4},
                                                      {"controller.K_v", 5},   {"controller.k_p", 2e5},
                                                      {"controller.T_N", 0.1}, {"controller.omega_ci", 800},
                                                      {"controller.T_E", 0.1}, {"controller.Omega_E", 0.1},
                                                      {"controller.T_ten", 60}};
    for (const auto& [path, value] : numbers) m.set(path, value);
    return m;
}

}  // namespace

int main() {
    const Inputs inputs{{"theta_ref", motion::jerk_limited_move(0.02, 0.03, 0.01, 0.05, 2.0)}};
    SimulateOptions options;
    options.end = 8.0;
    options.signals = {"e"};
    const Trajectory run = simulate(dual_servo(), inputs, options);

    double peak = 0.0;
    for (const double e : run.values) peak = std::max(peak, std::abs(e));
    std::cout << "dualdrive " << version() << ": " << status_name(run.status) << ", " << run.events.size()
              << " switches, peak following error " << peak * 180.0 / M_PI * 3600.0 << " arcsec\n";
    return run.status == Status::success ? 0 : 1;
}
