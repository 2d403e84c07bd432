// Effects in a motor, its circuit and its drive: the closed form of each.
#include <doctest/doctest.h>

#include <cmath>
#include <numbers>

#include "dualdrive/effects.hpp"

using namespace dualdrive;
using std::numbers::pi;

TEST_CASE("torque_ripple: proportional to the torque of the current") {
    const double values[]{0.02, 6.0, 0.0};
    const auto effect = make_effect<double>("torque_ripple", values);
    const auto ripple = [&](double angle, double torque) {
        return effect->torque_of_motor({.t = 0, .angle = angle, .speed = 0, .current = torque, .torque = torque});
    };
    CHECK(ripple(pi / 12, 50.0) == doctest::Approx(1.0));
    CHECK(ripple(pi / 12, -50.0) == doctest::Approx(-1.0));
    CHECK(ripple(pi / 12, 0.0) == 0.0);
    CHECK(std::abs(ripple(pi / 6, 50.0)) < 1e-14);
}

TEST_CASE("torque_constant_saturation: the parabola for small currents, a bound for large ones") {
    const double values[]{0.1};
    const auto effect = make_effect<double>("torque_constant_saturation", values);
    const auto torque = [&](double ideal) {
        return ideal + effect->torque_of_motor(
                           {.t = 0, .angle = 0, .speed = 0, .current = ideal, .torque = ideal, .rated_torque = 100});
    };
    CHECK(torque(10.0) == doctest::Approx(10.0 * (1 - 0.1 * 0.01)).epsilon(1e-5));
    CHECK(torque(100.0) == doctest::Approx(100.0 / std::sqrt(1.2)));
    CHECK(torque(-100.0) == doctest::Approx(-torque(100.0)));
    CHECK(torque(200.0) > torque(100.0));
    CHECK(torque(1e6) == doctest::Approx(100.0 / std::sqrt(0.2)).epsilon(1e-6));
}

TEST_CASE("thermal_drift: copper gains 0.393 %, flux loses 0.1 % per kelvin, and no power is made of it") {
    const double values[]{50.0, 1e-3};
    const auto effect = make_effect<double>("thermal_drift", values);
    const MotorPort<double> at{.t = 0,
                               .angle = 0,
                               .speed = 40,
                               .current = 60,
                               .torque = 72,
                               .resistance = 0.2,
                               .back_emf = 1.2,
                               .rated_torque = 100};
    CHECK(effect->torque_of_motor(at) == doctest::Approx(-0.05 * 72));
    CHECK(effect->voltage_of_motor(at) == doctest::Approx(0.05 * 1.2 * 40 - 0.1965 * 0.2 * 60));
    // what the flux takes from the torque it gives back to the circuit: K_d = C_e stays true
    const double copper = -0.1965 * 0.2 * 60;
    CHECK(effect->torque_of_motor(at) * at.speed + (effect->voltage_of_motor(at) - copper) * at.current ==
          doctest::Approx(0.0));
}

TEST_CASE("dead_time: the full voltage against a large current, three quarters of it in the zone, none at zero") {
    const double values[]{6.0, 0.5};
    const auto effect = make_effect<double>("dead_time", values);
    const auto voltage = [&](double I) {
        return effect->voltage_of_motor({.t = 0, .angle = 0, .speed = 0, .current = I, .torque = I});
    };
    CHECK(voltage(20.0) == doctest::Approx(-6.0));
    CHECK(voltage(-20.0) == doctest::Approx(6.0));
    CHECK(voltage(0.5) == doctest::Approx(-6.0 * 0.76159415595576));  // tanh 1
    CHECK(voltage(0.0) == 0.0);
}

TEST_CASE("tension_mismatch: so much more than it is") {
    const double values[]{0.05};
    CHECK(make_effect<double>("tension_mismatch", values)->torque_estimate(-80.0) == doctest::Approx(-84.0));
}
