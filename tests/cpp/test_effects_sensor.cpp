// Effects on what a sensor reads: the closed form of each.
#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <span>

#include "dualdrive/effects.hpp"

using namespace dualdrive;
using std::numbers::pi;

TEST_CASE("sensors: late by so much, wrong by so much") {
    const double value[]{2e-3};
    CHECK(make_effect<double>("sensor_delay", value)->delay() == 2e-3);
    CHECK(make_effect<double>("sensor_delay", value)->reading(0.5, {0.0}) == 0.5);
    CHECK(make_effect<double>("sensor_offset", value)->reading(0.5, {0.0}) == doctest::Approx(0.502));
}

TEST_CASE("quantisation: whole counts, ties to even, derivatives of the unrounded reading") {
    const double step[]{0.25}, none[]{0.0};
    const auto counts = make_effect<double>("quantisation", step);
    CHECK(counts->reading(0.3, {0.0}) == 0.25);
    CHECK(counts->reading(-0.4, {0.0}) == -0.5);
    CHECK(counts->reading(0.125, {0.0}) == 0.0);
    CHECK(counts->reading(0.375, {0.0}) == 0.5);
    CHECK(make_effect<double>("quantisation", none)->reading(0.3, {0.0}) == 0.3);
    const Gradient steps[]{Gradient(0.25)};
    const Gradient read = make_effect<Gradient>("quantisation", steps)->reading(Gradient::variable(0.3, 1), {0.0});
    CHECK(read.value == 0.25);
    CHECK(read.slope[1] == 1.0);
}

TEST_CASE("encoder_eccentricity: once per turn, in the angle and in the speed made from it") {
    const double values[]{1e-2, 0.3};
    const auto effect = make_effect<double>("encoder_eccentricity", values);
    const auto angle = [&](double x) { return effect->reading(x, {0.0, Measures::angle}); };
    CHECK(angle(-0.3) == doctest::Approx(-0.3 + 1e-2));
    CHECK(angle(pi - 0.3) == doctest::Approx(pi - 0.3 - 1e-2));
    const double at = 0.7, speed = 3.0, h = 1e-5;
    CHECK(effect->reading(speed, {0.0, Measures::speed, at, speed}) ==
          doctest::Approx(speed * (angle(at + h) - angle(at - h)) / (2 * h)).epsilon(1e-9));
    CHECK(effect->reading(5.0, {0.0}) == 5.0);  // neither: nothing to do with it
}

TEST_CASE("radial_shift: the tangential force at the head shifts the scale, the separating force a quarter turn on") {
    // 2 µm at 0.25 m are 8 µrad, 1.65″: 8 kN·m at 4 m is 2 kN, on 1 nm/N
    const ToothLoad<double> one[]{{8000.0, 8000.0}};
    const auto read = [&](double mesh_angle, std::span<const ToothLoad<double>> teeth) {
        const double values[]{1e-9, 0.25, 4.0, mesh_angle, pi, pi / 9};
        return make_effect<double>("radial_shift", values)->reading(0.0, {0.0, Measures::angle, 0.0, 0.0, teeth});
    };
    CHECK(read(0.0, one) == doctest::Approx(8e-6));
    CHECK(read(pi, one) == doctest::Approx(-8e-6));
    CHECK(read(pi / 2, one) == doctest::Approx(-8e-6 * std::tan(pi / 9)));
    const ToothLoad<double> together[]{{8000.0, 8000.0}, {8000.0, 8000.0}},
        tension[]{{8000.0, 8000.0}, {-8000.0, 8000.0}};
    CHECK(std::abs(read(0.3, together)) < 1e-20);  // opposite meshes that drive together make a couple
    CHECK(read(0.0, tension) == doctest::Approx(16e-6));
    CHECK(read(0.0, {}) == 0.0);
}

TEST_CASE("table_tilt: the moment of the tooth force, at the height of the scale") {
    const double values[]{1e-11, 0.5, 0.8, 0.25, 4.0, 0.0, pi, pi / 9};
    const ToothLoad<double> one[]{{8000.0, 8000.0}};  // 2 kN at 0.5 m: 1 kN·m, 10 nrad, 8 nm at the scale
    const auto effect = make_effect<double>("table_tilt", values);
    CHECK(effect->reading(0.0, {0.0, Measures::angle, 0.0, 0.0, one}) == doctest::Approx(8e-9 / 0.25));
}
