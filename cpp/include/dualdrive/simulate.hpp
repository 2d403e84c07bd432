// simulate(machine, inputs, options) -> trajectory, every switch located.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dualdrive/machine.hpp"
#include "dualdrive/signal.hpp"
#include "dualdrive/solver.hpp"
#include "dualdrive/trajectory.hpp"

namespace dualdrive {

struct SimulateOptions {
    double start = 0.0, end = 1.0;  // s
    double output_step = 1e-3;      // s; ignored where `times` is given
    std::vector<double> times;      // increasing, within [start, end]
    Engine engine = Engine::automatic;
    double rtol = 1e-10;  // local; the error reached is larger, see docs/theory/accuracy.md; exact: unused
    Method method = Method::automatic;  // of the cvode engine: adams for a plant that rings, bdf for a stiff one
    bool long_double = false;           // exact engine alone: its linear algebra in long double, for reference runs
    double longest_step = 0.0;          // s; 0 = no limit
    long max_steps = 50'000'000;
    std::vector<std::string> signals;        // to record; empty = all
    std::vector<std::string> sensitivities;  // parameter paths or groups, or initial.<state>
    std::vector<std::string> gradient;       // the same, for Trajectory::pull_back
    std::map<std::string, double> initial;   // state name -> value; all others 0
    bool energy = true;                      // keep the ledger of work
    std::function<bool()> interrupted;       // asked every few hundred steps
    // Takes what was recorded, `rows_per_block` rows at a time and the rest at the end; the trajectory keeps none then.
    std::function<void(const Trajectory&)> rows;
    static constexpr std::size_t rows_per_block = 1024;
};

// Errors: std::invalid_argument for a machine, input or option that makes no sense. Failures of the integration are a
// status of the trajectory, with all that was computed before.
Trajectory simulate(const Machine& machine, const Inputs& inputs, const SimulateOptions& options);

}  // namespace dualdrive
