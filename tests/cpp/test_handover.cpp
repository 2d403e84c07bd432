// Two solvers in turn: which of them has the run, and when.
#include <doctest/doctest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "../../cpp/src/solvers/cvode.hpp"
#include "../../cpp/src/solvers/explicit/runge_kutta.hpp"
#include "../../cpp/src/solvers/handover.hpp"

using namespace dualdrive;

namespace {

// A lag of 1/400 s behind sin(t): smooth beside its pole; from 50 s on it is rung by sin(900 t) besides.
struct Lag final : Problem {
    static constexpr double pole = 400.0, ringing = 900.0, rung_from = 50.0;
    bool rhs(double t, const double* z, double* f) override {
        f[0] = pole * (std::sin(t) - z[0] + (t > rung_from ? std::sin(ringing * t) : 0.0));
        return true;
    }
    bool guards(double, const double*, double*) override { return true; }
    bool jacobian(double, const double*, double* column) override {
        column[0] = -pole;
        return true;
    }
    bool sensitivity(double, const double*, const double* const*, double* const*) override { return false; }
    bool quadrature(double, const double*, double*) override { return false; }
    // what follows sin(w t) once the start has died away
    static double follows(double t, double w) {
        return pole * (pole * std::sin(w * t) - w * std::cos(w * t)) / (pole * pole + w * w);
    }
};

const Solver::Size size{1, 0, 0, 0};
const std::vector<double> none, tolerance{1e-8};

std::unique_ptr<RungeKutta> mild(Problem& law) {
    return std::make_unique<RungeKutta>(law, size, 1e-8, none, std::numeric_limits<double>::infinity());
}

void go_to(Solver& solver, double stop) {
    Solver::Outcome outcome;
    while ((outcome = solver.step(stop)) == Solver::Outcome::stepped) {
    }
    REQUIRE(outcome == Solver::Outcome::stopped);
}

struct Seen {
    std::vector<double> states;
    std::vector<long> steps, rates;
    bool operator==(const Seen&) const = default;
};

Seen seen(Solver& solver) {
    solver.restart(0.0, tolerance, 1e-8);
    Seen seen;
    for (const double stop : {40.0, 50.0, 60.0, 80.0, 100.0}) {
        go_to(solver, stop);
        seen.states.push_back(solver.state()[0]);
        seen.steps.push_back(solver.counts().steps);
        seen.rates.push_back(solver.counts().rhs);
        solver.restart(stop, tolerance, 1e-8);
    }
    return seen;
}

Seen in_turn() {
    Lag law;
    std::vector<Handover::Candidate> candidates;
    candidates.push_back({.make = [&] { return std::unique_ptr<Solver>(mild(law)); }, .price = {1.0, 0.0, 0.0}});
    candidates.push_back({.make =
                              [&] {
                                  return std::unique_ptr<Solver>(
                                      std::make_unique<Cvode>(law, size, Method::bdf, 1e-9, std::vector<int>{}, none));
                              },
                          .price = {0.0, 4.4, 14.0},
                          .share = 0.1});
    Handover solver(std::move(candidates), 0, 100.0);
    return seen(solver);
}

}  // namespace

TEST_CASE("the cheaper of two solvers has the run, and gives it back") {
    Lag law;
    const Seen both = in_turn(), alone = seen(*mild(law));
    CHECK(both.rates[0] < alone.rates[0] / 4);
    // while it rings a trial may cost an eighth
    CHECK(both.rates[4] - both.rates[2] > 0.8 * static_cast<double>(alone.rates[4] - alone.rates[2]));
    CHECK(both.rates[4] - both.rates[2] < 1.1 * static_cast<double>(alone.rates[4] - alone.rates[2]));
    CHECK(both.states[0] == doctest::Approx(Lag::follows(40.0, 1.0)).epsilon(1e-7));
    CHECK(both.states[4] ==
          doctest::Approx(Lag::follows(100.0, 1.0) + Lag::follows(100.0, Lag::ringing)).epsilon(1e-6));
}

TEST_CASE("the same run takes the same turns, to the bit") { CHECK(in_turn() == in_turn()); }
