// What Python threads do side by side without its lock: runs and predictions that share a machine and a record.
// `./dev test --threads` looks for races; without the sanitizer these are checks of bits.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "dualdrive/innovations.hpp"
#include "dualdrive/simulate.hpp"
#include "dualdrive/unit.hpp"
#include "held_pinions.hpp"

using namespace dualdrive;

namespace {

constexpr int several = 4;

// The same, softer and ten times as damped.
Machine sprung() {
    Machine m = bouncing();
    m.set("meshes.stiffness", 1e5);
    m.set("table.b", 50.0);
    return m;
}

Trajectory run(const Machine& machine, Engine engine) {
    SimulateOptions o;
    o.end = 0.5;
    o.engine = engine;
    o.initial = {{"omega_m", 0.1}};
    o.signals = {"omega_m", "theta_m"};
    return simulate(machine, {}, o);
}

SampledRecord swaying() {
    std::vector<double> times, measured;
    for (int k = 0; k < 200; ++k) {
        times.push_back(1e-3 * k);
        measured.push_back(1e-4 * std::sin(20.0 * times.back()));
    }
    return {{}, times, {{"theta_m", {}}}, measured};
}

template <class Work>
void side_by_side(Work work) {
    std::vector<std::thread> threads;
    for (int k = 0; k < several; ++k) threads.emplace_back([&work, k] { work(k); });
    for (auto& thread : threads) thread.join();
}

}  // namespace

TEST_CASE("runs of one machine side by side have the bits of one alone") {
    const Machine machine = sprung();
    for (const Engine engine : {Engine::exact, Engine::exponential, Engine::explicit_rk, Engine::cvode}) {
        const auto alone = run(machine, engine);
        REQUIRE(alone.status == Status::success);
        std::vector<Trajectory> found(several);
        side_by_side([&](int k) { found[static_cast<std::size_t>(k)] = run(machine, engine); });
        for (const auto& t : found) CHECK(t.values == alone.values);
    }
}

TEST_CASE("formulas, units and numbers of machines of their own are read side by side") {
    std::vector<double> found(several);
    side_by_side([&](int k) {
        Machine m = sprung();
        m.set("table.J", 10.0 + k);
        for (int again = 0; again < 50; ++again) (void)Unit::parse("kg*m^2/s^2");
        found[static_cast<std::size_t>(k)] = m.get("table.J");
    });
    for (int k = 0; k < several; ++k) CHECK(found[static_cast<std::size_t>(k)] == 10.0 + k);
}

TEST_CASE("predictions that share record and gains have the bits of one alone") {
    const Machine machine = sprung();
    const SampledRecord record = swaying();
    const NoiseModel noise{{{1e-6, 0.5, 1e-7}}, {{"table", {0.1, 0.99}}}};
    const KalmanGains gains = kalman_gains(machine, record, noise, 0.1);
    PredictionOptions options;
    KalmanGains own = gains;
    options.learn = true;
    const Prediction alone = predict(machine, record, own, options);
    REQUIRE(alone.finite);
    std::vector<Prediction> found(several);
    side_by_side([&](int k) {
        KalmanGains mine = gains;
        found[static_cast<std::size_t>(k)] = predict(machine, record, mine, options);
    });
    for (const auto& p : found) CHECK(p.residuals == alone.residuals);
}

TEST_CASE("sensitivities that share record and gains have the bits of one alone") {
    const Machine machine = sprung();
    Machine heavier = machine, unbalanced = machine;
    heavier.set("table.J", machine.get("table.J") * (1.0 + 1e-6));
    unbalanced.add_effect("unbalance", "table");
    unbalanced.set("unbalance@table.amplitude", 1e-3);
    const SampledRecord record = swaying();
    const NoiseModel noise{{{1e-6, 0.5, 1e-7}}, {{"table", {0.1, 0.99}}}};
    KalmanGains gains = kalman_gains(machine, record, noise, 0.1);
    const std::vector<Neighbour> neighbours = {{&heavier, {}, {}}, {&unbalanced, {}, {}}, {&machine, {}, {1e-6}}};
    const auto alone = sensitivities(machine, record, gains, {}, neighbours);
    for (const auto& own : alone) REQUIRE(own.size() == record.times().size());
    for (const auto& own : alone) CHECK(std::any_of(own.begin(), own.end(), [](double x) { return x != 0.0; }));
    std::vector<std::vector<std::vector<double>>> found(several);
    side_by_side(
        [&](int k) { found[static_cast<std::size_t>(k)] = sensitivities(machine, record, gains, {}, neighbours); });
    for (const auto& changes : found) CHECK(changes == alone);
}
