// Assemblies become states, groups and switching elements; what cannot move or moves twice is refused.
#include <doctest/doctest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "dualdrive/layout.hpp"
#include "dualdrive/machine.hpp"
#include "dualdrive/model.hpp"
#include "dualdrive/simulate.hpp"
#include "refusal.hpp"

using namespace dualdrive;
using Names = std::vector<std::string>;

namespace {

Machine drives(int count, ConnectionKind gearbox, ConnectionKind mesh) {
    Machine m;
    const auto name = [](const char* part, int n) { return part + std::to_string(n); };
    for (int n = 1; n <= count; ++n) {
        m.add_body(name("motor_", n));
        m.add_body(name("pinion_", n));
    }
    m.add_body("table");
    for (int n = 1; n <= count; ++n) {
        m.connect(name("gearbox_", n), name("motor_", n), name("pinion_", n), gearbox, TwistFrame::driven);
        m.connect(name("mesh_", n), name("pinion_", n), "table", mesh, TwistFrame::driver);
    }
    for (int n = 1; n <= count; ++n) m.add_motor(name("motor_", n), name("motor_", n), MotorKind::armature);
    if (mesh == ConnectionKind::gap) m.set("meshes.gap", 1e-3);
    return m;
}

Names elements(const Layout& layout) {
    Names names;
    for (const auto& s : layout.switches) names.push_back(s.name);
    return names;
}

}  // namespace

TEST_CASE("the paper's machine has the eight states of Eq. 23, twists in place of pinion angles") {
    const Layout l(drives(2, ConnectionKind::rigid, ConnectionKind::gap), {});
    CHECK(l.state_names ==
          Names{"omega_m", "omega_c1", "omega_c2", "mesh_1.twist", "mesh_2.twist", "theta_m", "I_1", "I_2"});
    CHECK(elements(l) == Names{"mesh_1", "mesh_2"});
    CHECK(l.groups == 3);
}

TEST_CASE("two bodies per drive add a speed and a twist each") {
    const Layout l(drives(2, ConnectionKind::compliant, ConnectionKind::gap), {});
    CHECK(l.groups == 5);
    CHECK(l.size() == 12);
    CHECK(l.state("gearbox_2.twist") >= 0);
    CHECK(l.state("omega_2") >= 0);
}

TEST_CASE("rigid meshes leave one speed, whose inertia is J_m + n i_m^2 (J_c + i^2 J_d)") {
    Machine m = drives(3, ConnectionKind::rigid, ConnectionKind::rigid);
    m.set("meshes.ratio", 20.0);
    m.set("gearboxes.ratio", 150.0);
    m.set("motors.J", 0.045);
    m.set("pinions.J", 60.0);
    m.set("table.J", 3e6);
    const Layout l(m, {});
    CHECK(l.groups == 1);
    CHECK(l.switches.empty());
    const Model<double> model(m, {}, l);
    CHECK(model.group_inertia(0) == doctest::Approx(3e6 + 3 * 400 * 1072.5).epsilon(1e-14));
}

TEST_CASE("a mesh without gap is a spring and never switches") {
    Machine m = drives(1, ConnectionKind::rigid, ConnectionKind::gap);
    m.set("mesh_1.gap", 0.0);
    CHECK(Layout(m, {}).switches.empty());
}

TEST_CASE("a split shaft: one motor, two pinions, one through a preloaded spring") {
    Machine m;
    for (const char* body : {"motor_1", "shaft", "pinion_1", "pinion_2", "table"}) m.add_body(body);
    m.connect("gearbox_1", "motor_1", "shaft", ConnectionKind::gap, TwistFrame::driven);
    m.connect("clutch", "shaft", "pinion_1", ConnectionKind::rigid, TwistFrame::driven);
    m.connect("spring", "shaft", "pinion_2", ConnectionKind::compliant, TwistFrame::driven);
    m.connect("mesh_1", "pinion_1", "table", ConnectionKind::gap, TwistFrame::driver);
    m.connect("mesh_2", "pinion_2", "table", ConnectionKind::gap, TwistFrame::driver);
    m.add_motor("motor_1", "motor_1", MotorKind::direct);
    for (const char* gap : {"gearbox_1.gap", "mesh_1.gap", "mesh_2.gap"}) m.set(gap, 1e-3);
    const Layout l(m, {});
    CHECK(l.groups == 4);  // table, shaft with pinion 1, pinion 2, motor
    CHECK(l.group_of[static_cast<std::size_t>(m.body("shaft"))] ==
          l.group_of[static_cast<std::size_t>(m.body("pinion_1"))]);
    CHECK(elements(l) == Names{"gearbox_1", "mesh_1", "mesh_2"});
}

TEST_CASE("a rigid loop is refused") {
    Machine m = drives(1, ConnectionKind::rigid, ConnectionKind::rigid);
    m.connect("strut", "motor_1", "table", ConnectionKind::rigid, TwistFrame::driver);
    CHECK(contains(refusal([&] { Layout(m, {}); }), "a rigid connection closes a loop"));
}

TEST_CASE("a part that moves needs inertia") {
    Machine m = drives(1, ConnectionKind::rigid, ConnectionKind::gap);
    m.set("motor_1.J", 0.0);
    m.set("pinion_1.J", 0.0);
    const Layout l(m, {});
    CHECK(contains(refusal([&] { Model<double>(m, {}, l); }), "a moving part needs inertia"));
}

TEST_CASE("a run can be stopped from outside and keeps what it has") {
    const Machine m = drives(2, ConnectionKind::rigid, ConnectionKind::gap);
    SimulateOptions o;
    o.end = 1e3;
    o.initial["omega_c1"] = 1.0;
    int asked = 0;
    o.interrupted = [&] { return ++asked > 3; };
    const Trajectory t = simulate(m, {}, o);
    CHECK(t.status == Status::interrupted);
    CHECK(t.t.size() > 1);
    CHECK(t.t.back() < 1e3);
    CHECK(t.values.size() == t.t.size() * t.signals.size());
}
