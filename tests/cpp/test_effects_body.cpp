// Effects on a body: friction, torques of the place and of time, inertia; the closed form of each.
#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "dualdrive/effects.hpp"

using namespace dualdrive;
using std::numbers::pi;

TEST_CASE("viscous: torque against speed") {
    const double b[]{650.0};
    const auto effect = make_effect<double>("viscous", b);
    CHECK(effect->torque_on_body({.t = 0, .angle = 1, .speed = 0.2, .mesh_torque = 0}) == doctest::Approx(-130.0));
}

TEST_CASE("coulomb: the limit of each direction") {
    const double values[]{300.0, 0.2};
    const auto effect = make_effect<double>("coulomb", values);
    CHECK(effect->friction_limit({}, 1) == doctest::Approx(360.0));
    CHECK(effect->friction_limit({}, -1) == doctest::Approx(240.0));
}

TEST_CASE("stribeck: breakaway, one Stribeck speed, far above it") {
    const double values[]{300.0, 1.5, 2e-3};
    const auto effect = make_effect<double>("stribeck", values);
    const auto limit = [&](double speed) {
        const BodyPort<double> at{.t = 0, .angle = 0, .speed = speed, .mesh_torque = 0};
        return effect->friction_limit(at, speed < 0 ? -1 : 1);
    };
    CHECK(limit(0.0) == doctest::Approx(450.0));
    CHECK(limit(2e-3) == doctest::Approx(300.0 + 150.0 / std::numbers::e));
    CHECK(limit(-2e-3) == limit(2e-3));
    CHECK(limit(0.1) == doctest::Approx(300.0));
}

TEST_CASE("lugre: the bristle of steady sliding carries the Stribeck curve") {
    const double values[]{300.0, 1.5, 2e-3, 1e6, 100.0};
    const auto effect = make_effect<double>("lugre", values);
    for (const double speed : {-5e-3, -1e-3, 1e-3, 2e-3, 0.1}) {
        const double level = 300.0 * (1.0 + 0.5 * std::exp(-std::pow(speed / 2e-3, 2)));
        const double bent = std::copysign(level / 1e6, speed);  // where dz/dt = 0
        const BodyPort<double> at{.t = 0, .angle = 0, .speed = speed, .mesh_torque = 0, .memory = &bent};
        double rate = 1.0;
        effect->flow(at, &rate);
        CHECK(std::abs(rate) < 1e-15);
        CHECK(effect->torque_on_body(at) == doctest::Approx(-std::copysign(level, speed)));
    }
}

TEST_CASE("angle_dependent_friction: twice the mean at its phase, nothing half a period on") {
    const double values[]{200.0, 3.0, 0.6};
    const auto effect = make_effect<double>("angle_dependent_friction", values);
    const auto limit = [&](double angle) { return effect->friction_limit({.t = 0, .angle = angle}, 1); };
    CHECK(limit(-0.2) == doctest::Approx(400.0));
    CHECK(limit(-0.2 + pi / 6) == doctest::Approx(200.0));
    CHECK(std::abs(limit(-0.2 + pi / 3)) < 1e-12);
    CHECK(effect->friction_limit({.t = 0, .angle = -0.2}, -1) == doctest::Approx(400.0));
}

TEST_CASE("load_dependent_mesh_loss: so much of what the mesh carries") {
    const double values[]{0.02};
    const auto effect = make_effect<double>("load_dependent_mesh_loss", values);
    CHECK(effect->friction_limit({.t = 0, .angle = 0, .speed = 1, .mesh_torque = 4500}, 1) == doctest::Approx(90.0));
    CHECK(effect->friction_limit({.t = 0, .angle = 0, .speed = 1, .mesh_torque = 0}, -1) == 0.0);
}

TEST_CASE("hydrostatic_drag: straight at low speed, square above") {
    const double values[]{1e6, 1e4};
    const auto effect = make_effect<double>("hydrostatic_drag", values);
    const auto torque = [&](double speed) { return effect->torque_on_body({.t = 0, .angle = 0, .speed = speed}); };
    CHECK(torque(0.05) == doctest::Approx(-3000.0));
    CHECK(torque(-0.05) == doctest::Approx(3000.0));
    CHECK(torque(1e-6) == doctest::Approx(-0.01).epsilon(1e-3));
}

TEST_CASE("unbalance: m g r of a mass beside an axis that lies") {
    const double values[]{20.0 * 9.81 * 0.5, 0.0};  // 20 kg at 0.5 m
    const auto effect = make_effect<double>("unbalance", values);
    CHECK(effect->torque_on_body({.t = 0, .angle = 0.0}) == doctest::Approx(98.1));
    CHECK(effect->torque_on_body({.t = 0, .angle = pi / 3}) == doctest::Approx(49.05));
    CHECK(effect->torque_on_body({.t = 0, .angle = pi}) == doctest::Approx(-98.1));
}

TEST_CASE("cogging: order periods per turn, no mean torque, no work over a turn") {
    const double values[]{1.5, 24.0, 0.3};
    const auto effect = make_effect<double>("cogging", values);
    const auto torque = [&](double angle) {
        return effect->torque_on_body({.t = 0, .angle = angle, .speed = 0, .mesh_torque = 0});
    };
    double work = 0.0, square = 0.0;
    const int points = 1000;
    for (int k = 0; k < points; ++k) {
        work += torque(2 * pi * k / points) / points;
        square += torque(2 * pi * k / points) * torque(2 * pi * k / points) / points;
    }
    CHECK(std::abs(work) < 1e-12);
    CHECK(square == doctest::Approx(1.5 * 1.5 / 2));
    CHECK(torque(0.2 + 2 * pi / 24) == doctest::Approx(torque(0.2)));
    CHECK(torque((pi / 2 - 0.3) / 24) == doctest::Approx(1.5));
}

TEST_CASE("cutting_torque: nothing outside its window, mean and harmonic inside, smooth at the edges") {
    const double values[]{1000.0, 300.0, 10.0, 2.0, 1.5, 0.1};
    const auto effect = make_effect<double>("cutting_torque", values);
    const auto torque = [&](double t) { return effect->torque_on_body({.t = t}); };
    CHECK(torque(1.999) == 0.0);
    CHECK(torque(3.501) == 0.0);
    CHECK(torque(2.5) == doctest::Approx(-1000.0));
    CHECK(torque(2.525) == doctest::Approx(-1300.0));
    CHECK(torque(2.05) == doctest::Approx(-500.0));  // half way in; the harmonic is at a zero
    std::vector<double> times;
    effect->instants(times);
    CHECK(times == std::vector<double>{2.0, 2.1, 3.4, 3.5});
}

TEST_CASE("position_dependent_inertia: its swing, and its slope by the angle") {
    const double values[]{0.25, 2.0, 0.0};
    const auto effect = make_effect<double>("position_dependent_inertia", values);
    const auto at = [&](double angle) {
        Dual<double, 1> inertia(8.0);
        effect->shape_inertia(inertia, Dual<double, 1>::variable(angle, 0));
        return inertia;
    };
    CHECK(at(0.0).value == doctest::Approx(10.0));
    CHECK(at(pi / 2).value == doctest::Approx(6.0));
    CHECK(at(pi / 4).slope[0] == doctest::Approx(-4.0));
}
