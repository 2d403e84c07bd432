// Effects on a mesh: stiffness, gap and deflection; the closed form of each.
#include <doctest/doctest.h>

#include <cmath>
#include <numbers>

#include "dualdrive/effects.hpp"

using namespace dualdrive;
using std::numbers::pi;

TEST_CASE(
    "hertzian_stiffness: stiffer by the growth at the reference overlap, and the torque is the energy's derivative") {
    using A = Dual<double, 2>;
    const double values[]{0.4, 1e-3};
    const auto effect = make_effect<double>("hertzian_stiffness", values);
    const MeshLaw<A> law{A(0.0), A(1e-3), A(2e7), A(0.0)};
    const auto at = [&](double overlap) {
        ContactSpring<A> spring{};
        effect->load_contact(spring, A::variable(overlap, 0), law);
        return spring;
    };
    CHECK(at(1e-3).torque.value == doctest::Approx(0.4 * 2e7 * 1e-3).epsilon(1e-4));
    CHECK(at(4e-3).torque.value == doctest::Approx(2 * 0.4 * 2e7 * 4e-3).epsilon(1e-5));
    CHECK(at(1e-3).energy.value == doctest::Approx(0.4 * 0.4 * 2e7 * 1e-6).epsilon(1e-3));  // ∫ K h ξ^(3/2) dξ
    for (const double overlap : {-1e-6, 0.0, 1e-5, 3e-4, 2e-3})
        CHECK(at(overlap).energy.slope[0] == doctest::Approx(at(overlap).torque.value));
    CHECK(at(0.0).torque.value == 0.0);
    CHECK(std::abs(at(0.0).energy.value) < 1e-15);
}

TEST_CASE("time_varying_mesh_stiffness: its swing, at the tooth order") {
    using A = Dual<double, 2>;
    const double values[]{0.2, 18.0, 0.5}, stiffness = 2e7, overlap = 1e-3;
    const auto effect = make_effect<double>("time_varying_mesh_stiffness", values);
    const auto at = [&](double angle) {
        MeshLaw<A> law{A(0.0), A(0.0), A(stiffness), A(0.0)};
        const A pinion = A::variable(angle, 0);
        effect->shape_mesh(law, {A(0.0), pinion, A(0.0), pinion, 1});
        return law.stiffness;
    };
    CHECK(at(-0.5 / 18).value == doctest::Approx(2.4e7));
    CHECK(at((pi - 0.5) / 18).value == doctest::Approx(1.6e7));
    // the pinion feels ½ ξ² dK/dθ: steepest a quarter period on
    CHECK(0.5 * overlap * overlap * at((pi / 2 - 0.5) / 18).slope[0] ==
          doctest::Approx(-0.5 * overlap * overlap * stiffness * 0.2 * 18.0));
}

TEST_CASE("transmission_error: deflection at the tooth order, levered by the teeth") {
    using A = Dual<double, 2>;
    const double values[]{1e-5, 25.0, 0.0};
    MeshLaw<A> law{A(0.0), A(0.0), A(2e7), A(0.0)};
    const A pinion = A::variable(2 * pi / 25 / 4, 0);
    make_effect<double>("transmission_error", values)->shape_mesh(law, {A(0.0), pinion, A(0.0), pinion, 1});
    CHECK(std::abs(law.offset.value) < 1e-20);
    CHECK(law.offset.slope[0] == doctest::Approx(-25e-5));
}

TEST_CASE("pitch_error: so many periods per turn, the second mesh a spacing on") {
    using A = Dual<double, 2>;
    const double values[]{2e-4, 3.0, 0.5, pi / 2};
    const auto effect = make_effect<double>("pitch_error", values);
    const auto offset = [&](double angle, int number) {
        MeshLaw<A> law{0.0, 0.0, 1.0, 0.0};
        effect->shape_mesh(law, {0.0, 0.0, A::variable(angle, 1), A::variable(angle, 1), number});
        return law.offset;
    };
    CHECK(offset(0.2, 1).value == doctest::Approx(2e-4 * std::cos(1.1)));
    CHECK(offset(0.2, 1).slope[1] == doctest::Approx(-6e-4 * std::sin(1.1)));
    CHECK(offset(0.2, 2).value == doctest::Approx(2e-4 * std::cos(1.1 + 1.5 * pi)));
}
TEST_CASE("eccentricity: mesh forces are the derivatives of the mesh energy") {
    using A = Dual<double, 2>;
    const double a = 1e-2, phase = 0.4, spacing = 2.1, stiffness = 2e7, gap = 1e-3, ratio = 20.0;
    const double values[]{a, phase, spacing};
    const auto effect = make_effect<double>("eccentricity", values);
    const double pinion = 0.7, ring = 0.03;
    const double twist = pinion - ratio * ring;

    const auto energy = [&](bool at_ring, int number) {
        const A p = A::variable(pinion, 0), r = A::variable(ring, 1);
        MeshLaw<A> law{A(0.0), A(gap), A(stiffness), A(0.0)};
        effect->shape_mesh(law, {p - ratio * r, p, r, at_ring ? r : p, number});
        const A x = p - ratio * r + law.offset - law.gap;
        return 0.5 * law.stiffness * x * x;
    };
    SUBCASE("of the pinion: its torque gains the lever of the eccentricity") {
        const double x = twist + a * std::cos(pinion + phase) - gap;
        const A v = energy(false, 1);
        CHECK(v.slope[0] == doctest::Approx(stiffness * x * (1.0 - a * std::sin(pinion + phase))));
        CHECK(v.slope[1] == doctest::Approx(-stiffness * x * ratio));
    }
    SUBCASE("of the ring: mesh 2 sees it `spacing` away from mesh 1") {
        for (const int number : {1, 2, 3}) {
            const double angle = ring + (number - 1) * spacing + phase;
            const double x = twist + a * std::cos(angle) - gap;
            const A v = energy(true, number);
            CHECK(v.slope[0] == doctest::Approx(stiffness * x));
            CHECK(v.slope[1] == doctest::Approx(-stiffness * x * (ratio + a * std::sin(angle))));
        }
    }
}

TEST_CASE("wear: widest at its centre, a bell beside it, periodic, never a smaller gap") {
    using A = Dual<double, 2>;
    const double values[]{5e-4, 1.0, 0.1, 1.0};
    const auto effect = make_effect<double>("wear", values);
    const auto gap = [&](double angle) {
        MeshLaw<A> law{A(0.0), A(1e-3), A(2e7), A(0.0)};
        effect->shape_mesh(law, {A(0.0), A(0.0), A(angle), A(angle), 1});
        return law.gap.value;
    };
    CHECK(gap(1.0) == doctest::Approx(1.5e-3));
    CHECK(gap(1.1) == doctest::Approx(1e-3 + 5e-4 * std::exp(-0.5)).epsilon(1e-3));
    CHECK(gap(1.1 + 2 * pi) == doctest::Approx(gap(1.1)));
    for (double angle = 0.0; angle < 7.0; angle += 0.01) CHECK(gap(angle) >= 1e-3);
}

TEST_CASE("effects add to a mesh, they do not overwrite it") {
    using A = Dual<double, 2>;
    MeshLaw<A> law{A(1e-4), A(1e-3), A(2e7), A(100.0)};
    const double damping[]{2e4}, eccentric[]{1e-4, 0.0, 0.0};
    make_effect<double>("mesh_damping", damping)->shape_mesh(law, {0.0, 0.0, 0.0, 0.0, 1});
    make_effect<double>("eccentricity", eccentric)->shape_mesh(law, {0.0, 0.0, 0.0, 0.0, 1});
    CHECK(law.damping.value == doctest::Approx(20100.0));
    CHECK(law.offset.value == doctest::Approx(2e-4));
    CHECK(law.stiffness.value == 2e7);
    CHECK(law.gap.value == 1e-3);
}
