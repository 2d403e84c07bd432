// The explicit engine: its steps against closed forms. Its coefficients: test_explicit_coefficients.cpp.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "../../cpp/src/solvers/explicit/runge_kutta.hpp"
#include "../../cpp/src/solvers/handover.hpp"

using namespace dualdrive;

// --------------------------------------------------------------------------------- steps, by closed forms

namespace {

struct Law final : Problem {
    std::function<void(double, const double*, double*)> rate;
    std::function<void(double, const double*, const double*, double*)> slope;
    int states = 1;
    long calls = 0;

    bool rhs(double t, const double* z, double* f) override {
        ++calls;
        rate(t, z, f);
        return std::all_of(f, f + states, [](double v) { return std::isfinite(v); });
    }
    bool guards(double, const double*, double*) override { return true; }
    bool jacobian(double, const double*, double*) override { return false; }
    bool sensitivity(double t, const double* z, const double* const* s, double* const* f) override {
        slope(t, z, s[0], f[0]);
        return true;
    }
    bool quadrature(double t, const double* z, double* f) override {
        f[0] = z[0] * std::cos(t);
        return true;
    }
};

// y' = p y cos t: y = exp(p sin t), dy/dp = sin t exp(p sin t), and for p = 1 ∫ y cos t = y − 1.
Law swell() {
    Law law;
    law.rate = [](double t, const double* z, double* f) { f[0] = z[0] * std::cos(t); };
    law.slope = [](double t, const double* z, const double* s, double* f) { f[0] = (s[0] + z[0]) * std::cos(t); };
    return law;
}

double swell_at(double t) { return std::exp(std::sin(t)); }

constexpr double never = std::numeric_limits<double>::infinity();

std::unique_ptr<RungeKutta> started(Law& law, double rtol, double y0, Solver::Size size = {1, 0, 0, 0},
                                    double stiff_beyond = never, double atol = 0.0) {
    const std::vector<double> scale(static_cast<std::size_t>(size.sensitivities), 1.0);
    auto solver = std::make_unique<RungeKutta>(law, size, rtol, scale, stiff_beyond);
    solver->state()[0] = y0;
    solver->restart(0.0, std::vector<double>{atol > 0 ? atol : rtol}, rtol);
    return solver;
}

struct Errors {
    double at_end = 0.0, inside = 0.0;
};

// Steps of one length: a tolerance that never limits, and a longest step.
Errors errors_of_steps(double h) {
    Law law = swell();
    auto solver = started(law, 1e6, 1.0);
    solver->limit_step(h, std::numeric_limits<double>::infinity());
    Errors worst;
    while (solver->step(8.0) == Solver::Outcome::stepped) {
        worst.at_end = std::max(worst.at_end, std::abs(solver->state()[0] - swell_at(solver->time())));
        const double from = solver->previous_time(), span = solver->time() - from;
        for (const double x : {0.15, 0.3, 0.5, 0.7, 0.9}) {
            double y = 0.0;
            solver->state_at(from + x * span, &y);
            worst.inside = std::max(worst.inside, std::abs(y - swell_at(from + x * span)));
        }
    }
    return worst;
}

}  // namespace

TEST_CASE("errors fall with the eighth power of the step, inside it with the seventh at least") {
    const Errors coarse = errors_of_steps(0.5), fine = errors_of_steps(0.25);
    CHECK(std::log2(coarse.at_end / fine.at_end) == doctest::Approx(8.0).epsilon(0.1));
    CHECK(std::log2(coarse.inside / fine.inside) > 6.9);
}

namespace {

struct Sampled {
    double error = 0.0, inside = 0.0;
    long rhs = 0, steps = 0;
};

// From sample to sample, an interval apart, and a new start at each.
Sampled sampled(double interval, double rtol) {
    Law law = swell();
    auto solver = started(law, rtol, 1.0);
    Sampled found;
    for (int k = 1; k * interval < 8.0; ++k) {
        while (solver->step(k * interval) == Solver::Outcome::stepped) {
        }
        const double from = solver->previous_time(), t = solver->time();
        found.error = std::max(found.error, std::abs(solver->state()[0] - swell_at(t)));
        for (const double x : {0.2, 0.5, 0.8}) {
            double y = 0.0;
            solver->state_at(from + x * (t - from), &y);
            found.inside = std::max(found.inside, std::abs(y - swell_at(from + x * (t - from))));
        }
        solver->restart(t, std::vector<double>{rtol}, rtol);
    }
    found.rhs = solver->counts().rhs, found.steps = solver->counts().steps;
    return found;
}

}  // namespace

TEST_CASE("from sample to sample, short steps are taken at half the work, to the same tolerance") {
    const Sampled fine = sampled(0.02, 1e-8);
    CHECK(fine.rhs < 9 * fine.steps);
    CHECK(fine.error < 1e-8);
    CHECK(fine.inside < 1e-8);
    const Sampled coarse = sampled(0.4, 1e-8);  // too long for order 5
    CHECK(coarse.rhs > 15 * coarse.steps);
    CHECK(coarse.error < 3e-8);
    CHECK(coarse.inside < 3e-8);
}

TEST_CASE("the error of short steps falls with the fifth power of the interval") {
    const Sampled coarse = sampled(0.1, 1e3), fine = sampled(0.05, 1e3);
    CHECK(std::log2(coarse.error / fine.error) == doctest::Approx(5.0).epsilon(0.1));
    CHECK(std::log2(coarse.inside / fine.inside) > 3.9);
}

TEST_CASE("the error reached goes with the tolerance") {
    for (const double rtol : {1e-5, 1e-8, 1e-11}) {
        CAPTURE(rtol);
        Law law = swell();
        auto solver = started(law, rtol, 1.0);
        double worst = 0.0;
        while (solver->step(20.0) == Solver::Outcome::stepped)
            worst = std::max(worst, std::abs(solver->state()[0] - swell_at(solver->time())));
        CHECK(worst < 30.0 * rtol);
        CHECK(worst > 0.01 * rtol);
        CHECK(solver->time() == 20.0);
    }
}

TEST_CASE("sensitivities and quadratures come along under the same tolerance") {
    Law law = swell();
    auto solver = started(law, 1e-10, 1.0, {1, 0, 1, 1});
    while (solver->step(3.0) == Solver::Outcome::stepped) {
        const double t = solver->previous_time() + 0.4 * (solver->time() - solver->previous_time());
        double s = 0.0, q = 0.0;
        solver->sensitivity_at(t, 0, &s);
        solver->quadrature_at(t, &q);
        CHECK(s == doctest::Approx(std::sin(t) * swell_at(t)).epsilon(1e-8));
        CHECK(q == doctest::Approx(swell_at(t) - 1.0).epsilon(1e-8));
    }
    CHECK(solver->sensitivity(0)[0] == doctest::Approx(std::sin(3.0) * swell_at(3.0)).epsilon(1e-8));
    CHECK(solver->quadrature()[0] == doctest::Approx(swell_at(3.0) - 1.0).epsilon(1e-8));
}

TEST_CASE("an error of the sensitivities alone shortens the steps") {
    Law law = swell();
    law.slope = [](double t, const double*, const double*, double* f) { f[0] = 100.0 * std::cos(100.0 * t); };
    auto solver = started(law, 1e-9, 1.0, {1, 0, 1, 0});
    while (solver->step(3.0) == Solver::Outcome::stepped) {
    }
    CHECK(solver->sensitivity(0)[0] == doctest::Approx(std::sin(300.0)).epsilon(1e-6));
    CHECK(solver->counts().steps > 100);
}

TEST_CASE("a step taken back is the solution up to there, and goes on from there") {
    Law law = swell();
    auto solver = started(law, 1e-10, 1.0);
    while (solver->time() < 1.0) solver->step(20.0);
    const double from = solver->previous_time(), t = from + 0.3 * (solver->time() - from);
    solver->go_back(t);
    CHECK(solver->time() == t);
    CHECK(solver->state()[0] == doctest::Approx(swell_at(t)).epsilon(1e-9));
    double y = 0.0;
    solver->state_at(from + 0.5 * (t - from), &y);
    CHECK(y == doctest::Approx(swell_at(from + 0.5 * (t - from))).epsilon(1e-9));
    solver->restart(t, std::vector<double>{1e-10}, 1e-10);
    while (solver->step(3.0) == Solver::Outcome::stepped) {
    }
    CHECK(solver->state()[0] == doctest::Approx(swell_at(3.0)).epsilon(1e-8));
}

TEST_CASE("a stop is met to the bit, without a tiny step before it") {
    Law law = swell();
    auto solver = started(law, 1e-10, 1.0);
    double shortest = never;
    for (const double stop : {0.1, 0.3, 0.7, 0.700000001, 1.1})
        for (auto outcome = Solver::Outcome::stepped; outcome != Solver::Outcome::stopped;) {
            outcome = solver->step(stop);
            REQUIRE(outcome != Solver::Outcome::failed);
            if (stop != 0.700000001 && solver->previous_time() > 0.1)
                shortest = std::min(shortest, solver->time() - solver->previous_time());
            if (outcome == Solver::Outcome::stopped) CHECK(solver->time() == stop);
        }
    CHECK(shortest > 0.02);
}

// A lag that follows slowly lets steps grow until its own pole, long quiet, grows again within each of them. At the
// steps' ends little is seen of that.
TEST_CASE("a fast motion that has died away stays quiet inside the steps") {
    constexpr double pole = 1500.0, slow = 0.3;
    Law law;
    law.rate = [](double t, const double* z, double* f) { f[0] = pole * (std::sin(slow * t) - z[0]); };
    const auto follows = [](double t) {
        return pole * (pole * std::sin(slow * t) - slow * std::cos(slow * t)) / (pole * pole + slow * slow);
    };
    auto solver = started(law, 1e-10, follows(0.0), {1, 0, 0, 0}, never, 1e-10);
    double worst = 0.0;
    while (solver->step(1.0) == Solver::Outcome::stepped)
        for (const double x : {0.2, 0.4, 0.6, 0.8}) {
            const double t = solver->previous_time() + x * (solver->time() - solver->previous_time());
            double y = 0.0;
            solver->state_at(t, &y);
            worst = std::max(worst, std::abs(y - follows(t)));
        }
    CHECK(worst < 5e-10);
    CHECK(solver->counts().steps < 600);
}

// ------------------------------------------------------------------------------------ where it cannot go on

TEST_CASE("a law that stops being a number is told as such") {
    Law law;
    law.rate = [](double t, const double*, double* f) { f[0] = std::sqrt(0.5 - t); };
    auto solver = started(law, 1e-8, 0.0);
    Solver::Outcome outcome;
    while ((outcome = solver->step(1.0)) == Solver::Outcome::stepped) {
    }
    CHECK(outcome == Solver::Outcome::failed);
    CHECK(solver->time() == doctest::Approx(0.5).epsilon(1e-6));
    CHECK(solver->failure().advice == Solver::not_finite);
    CHECK(solver->state()[0] == doctest::Approx(2.0 / 3.0 * std::pow(0.5, 1.5)).epsilon(1e-5));
}

TEST_CASE("a motion that explodes ends with a step that vanished") {
    Law law;
    law.rate = [](double, const double* z, double* f) { f[0] = z[0] * z[0]; };
    auto solver = started(law, 1e-8, 1.0);
    Solver::Outcome outcome;
    while ((outcome = solver->step(2.0)) == Solver::Outcome::stepped) {
    }
    CHECK(outcome == Solver::Outcome::failed);
    CHECK(solver->time() == doctest::Approx(1.0).epsilon(1e-5));
    CHECK(solver->failure().advice.find("bdf") != std::string::npos);
}

TEST_CASE("a stiff problem is known as one, one that is merely fast is not") {
    const auto lag = [](double pole, double stiff_beyond) {
        Law law;
        law.rate = [pole](double t, const double* z, double* f) { f[0] = pole * (std::cos(t) - z[0]); };
        auto solver = started(law, 1e-7, 0.0, {1, 0, 0, 0}, stiff_beyond);
        while (!solver->stiff() && solver->step(1.0) == Solver::Outcome::stepped) {
        }
        return solver->stiff();
    };
    CHECK(lag(1e5, 5e3));
    CHECK_FALSE(lag(1e3, 5e3));
    Law ring = swell();  // as fast, but the accuracy of its ringing limits the steps
    ring.rate = [](double t, const double*, double* f) { f[0] = std::cos(1e4 * t); };
    auto solver = started(ring, 1e-7, 0.0, {1, 0, 0, 0}, 5e3);
    while (solver->step(0.1) == Solver::Outcome::stepped) CHECK_FALSE(solver->stiff());
}

TEST_CASE("what turns out stiff is handed over as it stands") {
    Law law;
    law.rate = [](double t, const double* z, double* f) { f[0] = (t < 0.5 ? 1.0 : 1e5) * (std::cos(t) - z[0]); };
    law.slope = [](double t, const double*, const double* s, double* f) { f[0] = (t < 0.5 ? 1.0 : 1e5) * -s[0] + 1.0; };
    Law mild = swell();  // the law to go on with
    const Solver::Size size{1, 0, 1, 1};
    auto first = started(law, 1e-7, 1.0, size, 5e3);
    std::vector<Handover::Candidate> candidates;
    candidates.push_back({.make = [&] { return std::unique_ptr<Solver>(std::move(first)); }, .price = {1.0, 0.0, 0.0}});
    candidates.push_back({.make = [&] { return std::unique_ptr<Solver>(started(mild, 1e-9, 0.0, size)); },
                          .price = {0.0, 4.4, 14.0},
                          .share = 0.1});
    Handover solver(std::move(candidates), size.sensitivities, 2.0);
    solver.restart(0.0, std::vector<double>{1e-7}, 1e-7);
    double y = 0.0, s = 0.0, q = 0.0;
    while (solver.name() == "dop853") {
        y = solver.state()[0], s = solver.sensitivity(0)[0], q = solver.quadrature()[0];
        REQUIRE(solver.step(2.0) == Solver::Outcome::stepped);
    }
    CHECK(solver.name() == "dop853, dop853");
    const double from = solver.previous_time(), grown = swell_at(solver.time()) / swell_at(from);
    CHECK(from > 0.5);
    CHECK(solver.state()[0] == doctest::Approx(y * grown).epsilon(1e-8));
    CHECK(solver.sensitivity(0)[0] ==
          doctest::Approx(grown * (s + y * (std::sin(solver.time()) - std::sin(from)))).epsilon(1e-8));
    CHECK(solver.quadrature()[0] == doctest::Approx(q + y * (grown - 1.0)).epsilon(1e-8));
}
