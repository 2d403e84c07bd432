// What a simulation leaves: signals over time, modes, events, energy ledger, sensitivities, status, statistics.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dualdrive/model.hpp"
#include "dualdrive/signal.hpp"
#include "dualdrive/switching.hpp"

namespace dualdrive {

enum class Status {
    success,
    interrupted,  // stopped from outside; what was computed is kept
    chattering,   // a switching element would not settle
    too_many_steps,
    step_too_small,
    not_finite,
    solver_failure,
};
const char* status_name(Status status);

struct Event {
    double t;
    int element;  // of Trajectory::elements
    Mode from, to;
};

struct Statistics {
    long steps = 0, rhs = 0, jacobians = 0, guards = 0, restarts = 0, error_test_failures = 0, grazing = 0;
    std::string method;         // adams or bdf
    double energy_error = 0.0;  // |ΔE − Σ work| over the energy that moved, worst over the run
};

// Arrays are row-major: one row per output time.
struct Trajectory {
    std::vector<double> t;
    std::vector<SignalInfo> signals;
    std::vector<double> values;  // t × signals
    std::vector<Switch> elements;
    std::vector<Mode> modes;  // t × elements
    std::vector<Event> events;
    std::vector<std::string> parameters;  // of the sensitivities
    std::vector<double> sensitivities;    // t × signals × parameters
    std::vector<double> work;             // t × powers: energy that went in by each path since the start
    std::vector<double> final_state;
    std::vector<std::string> state_names;
    std::vector<std::string> gradient;  // parameters of pull_back
    // ∂(cost)/∂(those parameters) from ∂(cost)/∂(every recorded value), t × signals; null unless asked for. One walk
    // backwards, whatever the number of parameters.
    std::function<std::vector<double>(const std::vector<double>&)> pull_back;
    Status status = Status::success;
    std::string message;  // what went wrong and what to try
    Statistics statistics;
};

}  // namespace dualdrive
