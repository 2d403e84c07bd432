// Every registered effect: declarations, hooks, passivity, slopes, energy; then the closed form of each.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "dualdrive/effects.hpp"
#include "dualdrive/nearest.hpp"

using namespace dualdrive;
using std::numbers::pi;

namespace {

// What an effect may depend on besides its parameters, in this order.
const std::vector<std::string> quantities{"angle",      "speed",  "current torque", "twist", "pinion angle",
                                          "ring angle", "signal", "memory",         "time",  "mesh torque"};

// Everything an effect answers at one state, as plain scalars. Mesh forces are the slopes of the mesh energy.
template <class S>
std::vector<S> answers(const std::string& name, const std::vector<S>& values, const std::vector<S>& q) {
    using A = Dual<S, 2>;
    const auto effect = make_effect<S>(name, values.data());
    const BodyPort<S> body{.t = q[8], .angle = q[0], .speed = q[1], .mesh_torque = q[9], .memory = &q[7]};
    S memory_rate(0.0);
    effect->flow(body, &memory_rate);
    const MotorPort<S> motor{.t = S(0.0),
                             .angle = q[0],
                             .speed = q[1],
                             .current = q[2],
                             .torque = q[2],
                             .resistance = S(0.3),
                             .back_emf = S(1.2),
                             .rated_torque = S(2.0)};

    const double ratio = 20.0;
    const A pinion = A::variable(q[4], 0), ring = A::variable(q[5], 1);
    const A twist = A(q[3]) + (pinion - A(q[4])) - ratio * (ring - A(q[5]));
    MeshLaw<A> law{A(0.0), A(1e-3), A(2.0), A(0.0)};
    effect->shape_mesh(law, {.twist = twist, .pinion_angle = pinion, .ring_angle = ring, .angle = ring, .number = 2});
    const A deflection = twist + law.offset - law.gap;
    ContactSpring<A> spring{};
    effect->load_contact(spring, deflection, law);
    const A energy = 0.5 * law.stiffness * deflection * deflection + spring.energy;
    auto inertia = Dual<S, 1>(3.0);
    effect->shape_inertia(inertia, Dual<S, 1>::variable(q[0], 0));

    return {effect->torque_on_body(body),
            effect->friction_limit(body, 1),
            effect->friction_limit(body, -1),
            effect->torque_of_motor(motor),
            effect->voltage_of_motor(motor),
            effect->torque_estimate(q[2]),
            effect->reading(q[6], {S(0.0), Measures::angle}),
            effect->reading(q[6], {S(0.0), Measures::speed, q[0], q[1]}),
            effect->delay(),
            law.offset.value,
            law.gap.value,
            law.stiffness.value,
            law.damping.value,
            spring.torque.value,
            inertia.value,
            inertia.slope[0],
            energy.value,
            energy.slope[0],
            energy.slope[1],
            memory_rate};
}

std::vector<std::string> split(const char* list) {
    std::vector<std::string> words;
    std::istringstream in{list};
    for (std::string word; std::getline(in, word, ',');) words.push_back(word);
    return words;
}

bool inside(double x, const Bounds& b) { return x <= b.high && (b.low_excluded ? x > b.low : x >= b.low); }

// The speed that an effect turns on, rad/s.
double usual_speed(const EffectType& type) {
    for (const auto& p : type.parameters)
        if (std::string(p.unit) == "rad/s") return p.typical;
    return 1.0;
}

// Parameters within their bounds and of usual size, and a state of the same order.
struct Draw {
    std::mt19937 random{20240229};
    double uniform(double low, double high) { return std::uniform_real_distribution<double>{low, high}(random); }

    std::vector<double> parameters(const EffectType& type) {
        std::vector<double> values;
        for (const auto& p : type.parameters) {
            const double low = std::max(p.bounds.low, p.standard - 2.0 * p.typical);
            const double high = std::min(p.bounds.high, p.standard + 2.0 * p.typical);
            values.push_back(low + (high - low) * uniform(0.05, 0.95));
        }
        return values;
    }
    std::vector<double> state(double speed) {
        std::vector<double> q(quantities.size());
        for (auto& x : q) x = uniform(-2.0, 2.0);
        q[1] = uniform(-2.0, 2.0) * speed;
        return q;
    }
};

template <class S>
std::vector<S> as(const std::vector<double>& x) {
    return {x.begin(), x.end()};
}

// The long double part of FineGradient, the one long double scalar effects are built for.
std::vector<long double> values_of(const std::vector<FineGradient>& x) {
    std::vector<long double> values;
    for (const auto& each : x) values.push_back(each.value);
    return values;
}

std::vector<double> standard(const EffectType& type) {
    std::vector<double> values;
    for (const auto& p : type.parameters) values.push_back(p.standard);
    return values;
}

}  // namespace

TEST_CASE("declarations are complete and consistent") {
    const std::set<std::string> units{
        "", "N*m", "N*m*s/rad", "N*m*s^2/rad^2", "N*m/rad", "rad", "rad/s", "s", "Hz", "V", "A", "K", "1/K"};
    const std::set<std::string> places{"table", "pinions", "motors", "meshes", "motor_2", "gearboxes", "controller"};
    std::set<std::string> names;
    for (const auto& type : effect_types()) {
        CAPTURE(std::string(type.text.name));
        CHECK(names.insert(type.text.name).second);
        CHECK((type.hooks != 0) != type.structural());
        CHECK_FALSE(type.parameters.empty());
        for (const char* text : {type.text.equation, type.text.source, type.text.validity, type.text.places})
            CHECK_FALSE(std::string(text).empty());
        for (const auto& place : split(type.text.places)) CHECK(places.contains(place));
        std::set<std::string> own;
        for (const auto& p : type.parameters) {
            CAPTURE(p.name);
            CHECK(own.insert(p.name).second);
            CHECK(units.contains(p.unit));
            CHECK_FALSE(std::string(p.doc).empty());
            CHECK(p.bounds.low < p.bounds.high);
            CHECK(inside(p.standard, p.bounds));
            CHECK(std::isfinite(p.typical));
            CHECK(p.typical > 0.0);
        }
    }
    for (const auto& type : effect_types())
        for (const auto& rival : split(type.text.confused_with)) CHECK_MESSAGE(names.contains(rival), rival);
}

TEST_CASE("an effect that has not been given a size changes nothing") {
    Draw draw;
    for (const auto& type : effect_types()) {
        CAPTURE(std::string(type.text.name));
        const auto q = draw.state(1.0);
        const auto with = answers<double>(type.text.name, standard(type), q);
        const auto without = answers<double>("viscous", {0.0}, q);
        for (std::size_t k = 0; k < with.size(); ++k) CHECK(with[k] == without[k]);
    }
}

TEST_CASE("hooks are found where an effect offers them, and only there") {
    const auto hooks = [](const char* name) { return effect_type(name).hooks; };
    CHECK(hooks("viscous") == hook::body);
    CHECK(hooks("coulomb") == hook::friction);
    CHECK(hooks("stribeck") == hook::friction);
    CHECK(hooks("lugre") == hook::body);
    CHECK(effect_type("lugre").memory == 1);
    CHECK(hooks("angle_dependent_friction") == hook::friction);
    CHECK(hooks("load_dependent_mesh_loss") == hook::friction);
    CHECK(hooks("mesh_damping") == hook::mesh);
    CHECK(hooks("hertzian_stiffness") == hook::mesh);
    CHECK(hooks("time_varying_mesh_stiffness") == hook::mesh);
    CHECK(hooks("transmission_error") == hook::mesh);
    CHECK(hooks("wear") == hook::mesh);
    CHECK(hooks("unbalance") == hook::body);
    CHECK(hooks("cutting_torque") == hook::body);
    CHECK(hooks("hydrostatic_drag") == hook::body);
    CHECK(hooks("position_dependent_inertia") == hook::inertia);
    CHECK(hooks("eccentricity") == hook::mesh);
    CHECK(hooks("cogging") == hook::body);
    CHECK(hooks("torque_ripple") == hook::motor);
    CHECK(hooks("sensor_delay") == hook::delay);
    CHECK(hooks("sensor_offset") == hook::reading);
    CHECK(hooks("quantisation") == hook::reading);
    CHECK(hooks("encoder_eccentricity") == hook::reading);
    CHECK(hooks("torque_constant_saturation") == hook::motor);
    CHECK(hooks("thermal_drift") == (hook::motor | hook::voltage));
    CHECK(hooks("dead_time") == hook::voltage);
    CHECK(hooks("tension_mismatch") == hook::estimate);
    CHECK(effect_type("current_limit").part == Part::motor);
    CHECK(effect_type("voltage_limit").part == Part::motor);
    CHECK(effect_type("transport_delay").part == Part::controller);
    CHECK(effect_type("gearbox_backlash").joint == ConnectionKind::gap);
    CHECK(effect_type("shaft_compliance").joint == ConnectionKind::compliant);
}

TEST_CASE("dissipative effects never deliver power") {
    Draw draw;
    for (const char* name : {"viscous", "coulomb", "stribeck", "angle_dependent_friction", "load_dependent_mesh_loss",
                             "mesh_damping", "hydrostatic_drag"}) {
        CAPTURE(name);
        const auto& type = effect_type(name);
        for (int repeat = 0; repeat < 1000; ++repeat) {
            const auto values = draw.parameters(type);
            const auto q = draw.state(usual_speed(type));
            const auto effect = make_effect<double>(name, values.data());
            const double speed = q[1];
            const int direction = speed > 0 ? 1 : -1;
            const BodyPort<double> at{.t = 0, .angle = q[0], .speed = speed, .mesh_torque = std::abs(q[9])};
            const double torque = effect->torque_on_body(at) - direction * effect->friction_limit(at, direction);
            CHECK(torque * speed <= 0.0);
            CHECK(effect->friction_limit(at, -direction) >= 0.0);
            MeshLaw<Dual<double, 2>> law{0.0, 0.0, 1.0, 0.0};
            effect->shape_mesh(law, {0.0, 0.0, 0.0, 0.0, 1});
            CHECK(law.damping.value >= 0.0);
        }
    }
}

TEST_CASE("slopes by every parameter and every quantity agree with central differences") {
    Draw draw;
    for (const auto& type : effect_types()) {
        // a part of the machine has no law here; rounding has the slopes of what it rounds
        if (type.structural() || type.text.rounds) continue;
        for (int repeat = 0; repeat < 20; ++repeat) {
            auto x = draw.parameters(type);
            const std::size_t parameters = x.size();
            const auto q = draw.state(usual_speed(type));
            x.insert(x.end(), q.begin(), q.end());
            const auto value = [&](const auto& all) {
                using S = typename std::decay_t<decltype(all)>::value_type;
                const auto middle = all.begin() + static_cast<std::ptrdiff_t>(parameters);
                return answers<S>(type.text.name, std::vector<S>(all.begin(), middle),
                                  std::vector<S>(middle, all.end()));
            };
            for (std::size_t k = 0; k < x.size(); ++k) {
                CAPTURE(std::string(type.text.name));
                CAPTURE(k);
                auto dual = as<Gradient>(x);
                dual[k] = Gradient::variable(x[k], 3);
                const auto by_dual = value(dual);

                const long double scale = std::max(1e-6L, std::abs(static_cast<long double>(x[k])));
                const long double h = 2e-5L * scale;
                const auto shifted = [&](long double by) {
                    auto moved = as<FineGradient>(x);
                    moved[k].value += by;
                    return values_of(value(moved));
                };
                const auto up = shifted(h), down = shifted(-h), up2 = shifted(2 * h), down2 = shifted(-2 * h);
                for (std::size_t j = 0; j < up.size(); ++j) {
                    CAPTURE(j);
                    const long double difference = (8.0L * (up[j] - down[j]) - (up2[j] - down2[j])) / (12.0L * h);
                    const long double rounding = 1e-18L * (std::abs(up[j]) + std::abs(down[j])) / h;
                    const long double most = 1e-7L * (1.0L + std::abs(difference)) + rounding;
                    CHECK(std::abs(by_dual[j].slope[3] - difference) <= most);
                }
            }
        }
    }
}

TEST_CASE("affine is said where, and only where, second differences vanish") {
    Draw draw;
    for (const auto& type : effect_types()) {
        CAPTURE(std::string(type.text.name));
        double bend = 0.0;
        for (int repeat = 0; repeat < 20; ++repeat) {
            const auto values = as<FineGradient>(draw.parameters(type));
            const auto q = draw.state(usual_speed(type)), step = draw.state(usual_speed(type));
            const auto along = [&](double s) {
                auto moved = as<FineGradient>(q);
                for (std::size_t k = 0; k < q.size(); ++k) moved[k] += s * step[k];
                auto all = values_of(answers<FineGradient>(type.text.name, values, moved));
                all.resize(15);  // energy is quadratic by nature
                return all;
            };
            const auto left = along(-0.1), middle = along(0.0), right = along(0.1);
            for (std::size_t j = 0; j < left.size(); ++j) {
                const long double size = std::abs(left[j]) + std::abs(middle[j]) + std::abs(right[j]) + 1e-30L;
                bend = std::max(bend, static_cast<double>(std::abs(left[j] - 2.0L * middle[j] + right[j]) / size));
            }
        }
        // the size of a torque, which the port is given, bends where no flank owns its sign
        const bool bends = bend >= 1e-15 || type.text.name == std::string("load_dependent_mesh_loss");
        CHECK(type.text.affine == !bends);
    }
}

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

TEST_CASE("unbalance: m g r of a mass beside an axis that lies") {
    const double values[]{20.0 * 9.81 * 0.5, 0.0};  // 20 kg at 0.5 m
    const auto effect = make_effect<double>("unbalance", values);
    CHECK(effect->torque_on_body({.t = 0, .angle = 0.0}) == doctest::Approx(98.1));
    CHECK(effect->torque_on_body({.t = 0, .angle = pi / 3}) == doctest::Approx(49.05));
    CHECK(effect->torque_on_body({.t = 0, .angle = pi}) == doctest::Approx(-98.1));
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

TEST_CASE("hydrostatic_drag: straight at low speed, square above") {
    const double values[]{1e6, 1e4};
    const auto effect = make_effect<double>("hydrostatic_drag", values);
    const auto torque = [&](double speed) { return effect->torque_on_body({.t = 0, .angle = 0, .speed = speed}); };
    CHECK(torque(0.05) == doctest::Approx(-3000.0));
    CHECK(torque(-0.05) == doctest::Approx(3000.0));
    CHECK(torque(1e-6) == doctest::Approx(-0.01).epsilon(1e-3));
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

TEST_CASE("structural effects lend the declarations of the part, word for word") {
    for (const auto& field : Motor<double>::parameters())
        if (std::string(field.declaration.name) == "T_max")
            CHECK(std::string(effect_type("current_limit").parameters.at(0).doc) == field.declaration.doc);
    CHECK(effect_type("gearbox_backlash").parameters.at(0).name == std::string("gap"));
    CHECK(effect_type("gearbox_backlash").parameters.at(1).name == std::string("stiffness"));
    CHECK(effect_type("transport_delay").parameters.at(0).standard == 0.0);
}

TEST_CASE("an unknown effect is refused with the names it may have meant") {
    const double value[]{1.0};
    CHECK_THROWS_WITH_AS(effect_type("colomb"), doctest::Contains("'colomb'; nearest known: coulomb"),
                         std::invalid_argument);
    CHECK_THROWS_WITH_AS(make_effect<double>("sensor_ofset", value), doctest::Contains("sensor_offset"),
                         std::invalid_argument);
    CHECK(std::string(effect_type("coulomb").text.name) == "coulomb");
}

TEST_CASE("nearest names: edit distance, ties in given order, no more than asked") {
    CHECK(nearest("gap", {"ratio", "gpa", "gap_", "cap"}, 2) == std::vector<std::string>{"gap_", "cap"});
    CHECK(nearest("kitten", {"sitting", "kitchen"}, 5) == std::vector<std::string>{"kitchen", "sitting"});
    CHECK(nearest("x", {}).empty());
}
