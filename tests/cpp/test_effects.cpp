// Every registered effect: declarations, hooks, passivity, slopes, energy. The closed form of each: test_effects_*.cpp.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "dualdrive/effects.hpp"

using namespace dualdrive;

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
    const ToothLoad<S> teeth[]{{q[2], q[9]}, {q[9], q[2]}};
    auto inertia = Dual<S, 1>(3.0);
    effect->shape_inertia(inertia, Dual<S, 1>::variable(q[0], 0));

    return {effect->torque_on_body(body),
            effect->friction_limit(body, 1),
            effect->friction_limit(body, -1),
            effect->torque_of_motor(motor),
            effect->voltage_of_motor(motor),
            effect->torque_estimate(q[2]),
            effect->reading(q[6], {S(0.0), Measures::angle, S(0.0), S(0.0), teeth}),
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
    const std::set<std::string> units{"",  "N*m", "N*m*s/rad", "N*m*s^2/rad^2", "N*m/rad", "rad", "rad/s",    "s", "Hz",
                                      "V", "A",   "K",         "1/K",           "m",       "m/N", "rad/(N*m)"};
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

TEST_CASE("what an effect means as a hypothesis is said of effects, places and carriers that there are") {
    const std::set<std::string> carriers{"", "torque", "direction"};
    for (const auto& type : effect_types()) {
        CAPTURE(std::string(type.text.name));
        const HypothesisText& h = type.text.hypothesis;
        CHECK(carriers.contains(h.carrier));
        const auto usual = split(type.text.places);
        for (const auto& place : split(h.places)) CHECK(std::find(usual.begin(), usual.end(), place) != usual.end());
        const auto simpler = split(h.contains);
        for (std::size_t k = 0; k < simpler.size(); ++k) {
            // the nearest first: what comes later is in each that comes before
            const auto inner = split(effect_type(simpler[k]).text.hypothesis.contains);
            CHECK(inner ==
                  std::vector<std::string>(simpler.begin() + static_cast<std::ptrdiff_t>(k) + 1, simpler.end()));
        }
        CHECK(h.lowest_order >= 1.0);
        const bool counts =
            std::any_of(type.parameters.begin(), type.parameters.end(), [](const Declaration& d) { return d.counted; });
        CHECK((counts || h.lowest_order == 1.0));
    }
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
    CHECK(hooks("radial_shift") == hook::reading);
    CHECK(hooks("table_tilt") == hook::reading);
    CHECK(hooks("pitch_error") == hook::mesh);
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
