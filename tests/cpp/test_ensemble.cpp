// Ensembles: every run is the simulate() of its own machine, whatever the threads, and none stops another.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "dualdrive/ensemble.hpp"
#include "held_pinions.hpp"
#include "refusal.hpp"

using namespace dualdrive;

namespace {

constexpr double forever = std::numeric_limits<double>::infinity();

std::vector<double> grid(double end, std::size_t steps) {
    std::vector<double> t;
    for (std::size_t k = 0; k <= steps; ++k) t.push_back(end * static_cast<double>(k) / static_cast<double>(steps));
    return t;
}

// `runs` gaps from 0 on, thrown at 0.1 rad/s.
EnsemblePlan plan(std::size_t runs) {
    EnsemblePlan p;
    p.machine = bouncing();
    p.runs = runs;
    p.paths = {"meshes.gap"};
    for (std::size_t k = 0; k < runs; ++k) p.values.push_back(1e-4 * static_cast<double>(k));
    Scenario s;
    s.options.end = 0.5;
    s.options.initial = {{"omega_m", 0.1}};
    s.reductions = {{"theta_m", Measure::peak}, {"omega_m", Measure::rms, 0.1, 0.3}};
    p.scenarios = {s};
    p.times = grid(0.5, 500);
    p.signals = {"omega_m", "theta_m"};
    return p;
}

std::vector<EnsembleRun> all(Ensemble& runs) {
    std::vector<EnsembleRun> found;
    while (!runs.done())
        for (auto& run : runs.take(std::chrono::milliseconds(10))) found.push_back(std::move(run));
    return found;
}

std::vector<EnsembleRun> all(const EnsemblePlan& p, std::size_t threads,
                             Ensemble::Order order = Ensemble::Order::by_number) {
    Ensemble runs(p, threads, order);
    return all(runs);
}

// Bit by bit, NaN equal to itself.
bool same(const std::vector<double>& a, const std::vector<double>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

std::vector<double> without_seconds(std::vector<double> numbers) {
    numbers.pop_back();
    return numbers;
}

std::string refused(const EnsemblePlan& p, std::size_t threads = 1) {
    return refusal([&] { all(p, threads); });
}

}  // namespace

TEST_CASE("every run is the simulation of its own machine, to the last bit") {
    const EnsemblePlan p = plan(7);
    const auto found = all(p, 2);
    REQUIRE(found.size() == 7);
    for (std::size_t k = 0; k < 7; ++k) {
        Machine m = p.machine;
        m.set("meshes.gap", p.values[k]);
        SimulateOptions o = p.scenarios[0].options;
        o.times = p.times;
        o.signals = p.signals;
        const Trajectory t = simulate(m, {}, o);
        REQUIRE(found[k].number == k);
        REQUIRE(found[k].status == "success");
        std::vector<double> whole;
        for (std::size_t s = 0; s < 2; ++s)
            for (std::size_t row = 0; row < t.t.size(); ++row) whole.push_back(t.values[2 * row + s]);
        CHECK(same(found[k].signals, whole));
        double peak = 0.0;
        for (std::size_t row = 0; row < t.t.size(); ++row) peak = std::max(peak, std::abs(t.values[2 * row + 1]));
        CHECK(found[k].numbers[0] == peak);
    }
}

TEST_CASE("numbers and signals do not depend on threads or order") {
    EnsemblePlan p = plan(40);
    const auto reference = all(p, 1);
    for (const std::size_t threads : {2, 3, 64})
        for (const auto order : {Ensemble::Order::by_number, Ensemble::Order::as_finished}) {
            auto found = all(p, threads, order);
            if (order == Ensemble::Order::as_finished)
                std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.number < b.number; });
            REQUIRE(found.size() == 40);
            for (std::size_t k = 0; k < 40; ++k) {
                CHECK(found[k].number == k);
                CHECK(same(found[k].signals, reference[k].signals));
                CHECK(same(without_seconds(found[k].numbers), without_seconds(reference[k].numbers)));
            }
        }
}

TEST_CASE("a refused run and a failed one carry their status; the others succeed") {
    EnsemblePlan p = plan(6);
    p.paths = {"meshes.gap", "table.J", "initial.omega_m"};
    p.values = {1e-3, 100, .1, -1.0, 100, .1, 1e-3, 0, .1, 1e-3, 100, NAN, 1e-3, 100, 1e9, 1e-3, 100, .1};
    p.scenarios.assign(6, p.scenarios[0]);
    p.scenarios[5].options.max_steps = 3;
    p.scenarios[5].options.engine = Engine::cvode;
    const auto found = all(p, 2);
    REQUIRE(found.size() == 6);
    CHECK(found[0].status == "success");
    CHECK(found[1].status == "refused");
    CHECK(contains(found[1].message, "meshes.gap: -1"));
    CHECK(found[2].status == "refused");
    CHECK(contains(found[2].message, "inertia"));
    CHECK(found[3].status != "success");
    CHECK(found[5].status == "too_many_steps");
    for (const std::size_t k : {1, 2, 3, 5}) {
        CHECK(std::all_of(found[k].numbers.begin(), found[k].numbers.end(), [](double v) { return std::isnan(v); }));
        CHECK(found[k].numbers.size() == found[0].numbers.size());
    }
    CHECK(found[5].signals.size() == 2 * p.times.size());
    CHECK(std::isfinite(found[5].signals.front()));
    CHECK(std::isnan(found[5].signals.back()));
}

TEST_CASE("each run may have inputs and options of its own") {
    EnsemblePlan p = plan(2);
    p.paths.clear();
    p.values.clear();
    p.scenarios.assign(2, p.scenarios[0]);
    for (auto& s : p.scenarios) s.options.initial.clear();
    p.scenarios[1].inputs["T_load"] = Waveform(-200.0);
    p.machine.set("meshes.gap", 1.0);  // far from any flank
    p.signals = {"omega_m"};
    const auto found = all(p, 2);
    // J dω/dt = 200 − b ω from rest
    const double last = 200.0 / 5.0 * (1.0 - std::exp(-5.0 / 100.0 * 0.5));
    CHECK(found[0].signals.back() == 0.0);
    CHECK(found[1].signals.back() == doctest::Approx(last).epsilon(1e-8));
}

TEST_CASE("no more runs than the window allows are begun ahead of those taken") {
    const EnsemblePlan p = plan(300);
    Ensemble runs(p, 2, Ensemble::Order::as_finished);
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    runs.stop();  // nothing was taken: what was begun is all that comes
    const auto found = all(runs);
    CHECK(found.size() <= 4);  // a busy computer may have begun fewer
    std::set<std::size_t> numbers;
    for (const auto& run : found) {
        numbers.insert(run.number);
        CHECK(run.status == "success");
    }
    CHECK(numbers.size() == found.size());
    for (const std::size_t number : numbers) CHECK(number < 4);
}

TEST_CASE("closing cuts runs under way short") {
    EnsemblePlan p = plan(4);
    p.scenarios[0].options.end = 1e5;
    p.scenarios[0].options.engine = Engine::cvode;
    p.scenarios[0].options.longest_step = 1e-4;
    p.scenarios[0].options.max_steps = 2'000'000'000;  // an hour
    Ensemble runs(p, 2, Ensemble::Order::as_finished);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    runs.close();
    const auto found = all(runs);
    CHECK(found.size() <= 2);  // a busy computer may have begun fewer
    for (const auto& run : found) CHECK(run.status == "interrupted");
}

TEST_CASE("plans that make no sense are refused before any run") {
    EnsemblePlan p = plan(3);
    CHECK(contains(refused(p, 0), "threads"));
    p.paths = {"meshes.gop"};
    CHECK(contains(refused(p), "meshes.gap"));
    p = plan(3);
    p.values.pop_back();
    CHECK(contains(refused(p), "2 values for 3 runs"));
    p = plan(3);
    p.scenarios.resize(2, p.scenarios[0]);
    CHECK(contains(refused(p), "2 scenarios for 3 runs"));
    p = plan(3);
    p.times.clear();
    CHECK(contains(refused(p), "times"));
    p = plan(3);
    p.runs = 0;
    p.values.clear();
    CHECK(contains(refused(p), "no runs"));
}

// --- summaries: against closed forms ---------------------------------------------------------------

namespace {

double reduced(Measure measure, const std::vector<double>& t, const std::vector<double>& x, double begin = -forever,
               double end = forever, std::size_t block = 1'000'000) {
    Reducer r({"", measure, begin, end});
    for (std::size_t k = 0; k < t.size(); k += block) {
        const std::size_t rows = std::min(block, t.size() - k);
        r.add({t.data() + k, rows}, x.data() + k, 1);
    }
    return r.value();
}

}  // namespace

TEST_CASE("measures of a ramp on uneven times") {
    const std::vector<double> t{0.0, 0.1, 0.5, 0.6, 2.0}, x{-3.0, -2.8, -2.0, -1.8, 1.0};  // x = 2 t − 3
    CHECK(reduced(Measure::minimum, t, x) == -3.0);
    CHECK(reduced(Measure::maximum, t, x) == 1.0);
    CHECK(reduced(Measure::range, t, x) == 4.0);
    CHECK(reduced(Measure::peak, t, x) == 3.0);
    CHECK(reduced(Measure::final, t, x) == 1.0);
    CHECK(reduced(Measure::mean, t, x) == doctest::Approx(-1.0).epsilon(1e-15));  // exact for a line
    CHECK(reduced(Measure::mean, t, x, 0.1, 0.6) == doctest::Approx(-2.3).epsilon(1e-15));
    CHECK(reduced(Measure::maximum, t, x, 0.1, 0.6) == -1.8);
    CHECK(reduced(Measure::rms, {0.0, 1.0}, {3.0, 3.0}) == 3.0);
}

TEST_CASE("a window with one output time holds its value, one with none is NaN") {
    const std::vector<double> t{0.0, 1.0, 2.0}, x{5.0, -7.0, 9.0};
    CHECK(reduced(Measure::mean, t, x, 0.5, 1.5) == -7.0);
    CHECK(reduced(Measure::rms, t, x, 0.5, 1.5) == 7.0);
    CHECK(reduced(Measure::range, t, x, 0.5, 1.5) == 0.0);
    CHECK(std::isnan(reduced(Measure::final, t, x, 1.2, 1.8)));
    CHECK(std::isnan(reduced(Measure::mean, t, x, 3.0, 4.0)));
}

TEST_CASE("a summary has the same bits however the run was cut into blocks") {
    const auto t = grid(2.0, 1000);
    std::vector<double> x;
    for (const double at : t) x.push_back(std::sin(37.0 * at) + 0.3 * at);
    for (const auto m : {Measure::minimum, Measure::maximum, Measure::range, Measure::peak, Measure::mean, Measure::rms,
                         Measure::final})
        for (const std::size_t block : {1, 7, 64, 1000}) {
            CHECK(reduced(m, t, x, 0.3, 1.7, block) == reduced(m, t, x, 0.3, 1.7));
            CHECK(reduced(m, t, x, -forever, forever, block) == reduced(m, t, x));
        }
}

TEST_CASE("unknown measures are refused with those there are") {
    CHECK_THROWS_WITH_AS(static_cast<void>(measure_of("median")),
                         "measure = 'median' is unknown; choose one of min, max, range, peak, mean, rms, final",
                         std::invalid_argument);
}

TEST_CASE("flanks: contacts and reversals") {
    FlankCount f;
    f.add(flank::gap, flank::front);
    f.add(flank::front, flank::front_parting);
    f.add(flank::front_parting, flank::gap);
    f.add(flank::gap, flank::back);
    CHECK(f.contacts == 3);
    CHECK(f.reversals == 1);
    f.add(flank::back, flank::front);  // gap 0: at once
    CHECK(f.contacts == 3);
    CHECK(f.reversals == 2);
}
