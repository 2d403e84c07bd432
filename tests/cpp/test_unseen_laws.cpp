// Which rates a law bends, whatever its size; and what it would add at its typical size.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "../../cpp/src/solvers/unseen_laws.hpp"
#include "dualdrive/layout.hpp"
#include "dualdrive/machine.hpp"
#include "dualdrive/motion.hpp"

using namespace dualdrive;

namespace {

// Two motors with rigid reducers on one ring, under their controller.
Machine drive_train() {
    Machine m;
    for (const char* n : {"1", "2"}) {
        m.add_body(std::string("motor_") + n, false);
        m.add_body(std::string("pinion_") + n, false);
    }
    m.add_body("table", false);
    for (const std::string n : {"1", "2"}) {
        m.connect("gearbox_" + n, "motor_" + n, "pinion_" + n, ConnectionKind::rigid, TwistFrame::driven);
        m.connect("mesh_" + n, "pinion_" + n, "table", ConnectionKind::gap, TwistFrame::driver);
    }
    for (const char* n : {"1", "2"})
        m.add_motor(std::string("motor_") + n, std::string("motor_") + n, MotorKind::armature);
    m.set("meshes.gap", 1e-3);
    m.set("meshes.stiffness", 1e6);
    return m;
}

// Names of the states whose rates are bent with both meshes on a flank, after the parameter was asked for.
std::vector<std::string> bent(const Machine& m, const std::string& parameter) {
    const Inputs inputs{{"theta_ref", Waveform({0.0}, {Polynomial{0.1}, Polynomial{0.1, 0.2, 0.3}})}};
    const Layout layout(m, inputs);
    Modes modes(layout.switches.size(), 0);
    for (std::size_t e = 0; e < modes.size(); ++e)
        if (layout.switches[e].kind == SwitchKind::flank || layout.switches[e].kind == SwitchKind::stick)
            modes[e] = flank::front;
    BentRows rows(m, inputs, layout, values_at_size(m, {m.resolve(parameter)}));
    const std::vector<double> z(static_cast<std::size_t>(layout.size()), 0.01);
    std::vector<std::string> names;
    for (const int row : rows.in(modes, 1.0, z.data()))
        names.push_back(layout.state_names[static_cast<std::size_t>(row)]);
    return names;
}

// Whether the signal is affine there.
bool spared(const Machine& m, const std::string& signal) {
    const Inputs inputs{{"theta_ref", Waveform({0.0}, {Polynomial{0.1}, Polynomial{0.1, 0.2, 0.3}})}};
    const Layout layout(m, inputs);
    const std::vector<double> z(static_cast<std::size_t>(layout.size()), 0.01);
    return BentRows(m, inputs, layout, m.values())
        .spare({layout.signal(signal)}, Modes(layout.switches.size(), flank::front), 1.0, z.data());
}

using Names = std::vector<std::string>;

}  // namespace

TEST_CASE("an affine machine bends no rate") {
    Machine m = drive_train();
    CHECK(bent(m, "table.J") == Names{});
    m.add_effect("coulomb", "table");
    m.add_effect("mesh_damping", "meshes");
    CHECK(bent(m, "table.J") == Names{});
}

TEST_CASE("a law of size zero bends the rates it acts on, and no others") {
    Machine ripple = drive_train(), drag = drive_train(), cut = drive_train();
    ripple.add_effect("torque_ripple", "motor_1");
    CHECK(bent(ripple, "torque_ripple@motor_1.amplitude") == Names{"omega_c1"});
    drag.add_effect("hydrostatic_drag", "table");
    CHECK(bent(drag, "hydrostatic_drag@table.quadratic") == Names{"omega_m"});
    cut.add_effect("cutting_torque", "table");  // long before it begins
    cut.set("cutting_torque@table.start", 1e3);
    CHECK(bent(cut, "cutting_torque@table.mean") == Names{"omega_m"});
}

TEST_CASE("signals are spared where no law bends them") {
    Machine m = drive_train();
    for (const char* signal : {"e", "omega_m", "T_1", "alpha_m", "theta_ref"}) CHECK(spared(m, signal));
    CHECK_FALSE(spared(m, "energy.stored"));
    m.add_effect("unbalance", "table");
    CHECK(spared(m, "e"));
    CHECK_FALSE(spared(m, "alpha_m"));
    CHECK_FALSE(spared(m, "unbalance@table"));
}

TEST_CASE("what laws of nearly no size would add is that of their typical size") {
    Machine m = drive_train();
    m.add_effect("unbalance", "table");
    const std::size_t slot = m.resolve("unbalance@table.amplitude").front();
    CHECK(m.values()[slot] == 0.0);
    CHECK(values_at_size(m, {{slot}})[slot] == m.slots()[slot].typical);
    CHECK(values_at_size(m, {}) == m.values());
    CHECK(values_at_size(m, {m.resolve("table.J")}) == m.values());
    m.set("unbalance@table.amplitude", 0.1);
    CHECK(values_at_size(m, {{slot}}) == m.values());
}
