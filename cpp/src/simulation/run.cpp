#include "simulation.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "affine.hpp"
#include "instant.hpp"

namespace dualdrive {

namespace {

constexpr long interrupt_period = 16;  // steps between questions whether to stop
constexpr long stall_period = 20'000;  // so many steps must bring the run on by stall_progress of its length
constexpr double stall_progress = 1e-5;
constexpr long pace_period = 500'000;  // steps by whose pace the rest of the run is reckoned
constexpr double pace_doubt = 2.0;     // the pace may still change: so many times max_steps are too many

}  // namespace

const char* status_name(Status status) {
    switch (status) {
        case Status::success:
            return "success";
        case Status::interrupted:
            return "interrupted";
        case Status::chattering:
            return "chattering";
        case Status::too_many_steps:
            return "too_many_steps";
        case Status::step_too_small:
            return "step_too_small";
        case Status::not_finite:
            return "not_finite";
        case Status::solver_failure:
            return "solver_failure";
    }
    return "unknown";
}

Trajectory simulate(const Machine& machine, const Inputs& inputs, const SimulateOptions& options) {
    if (options.gradient.empty()) return Simulation(machine, inputs, options).run();
    const auto taped = std::make_shared<Simulation>(machine, inputs, options);
    Trajectory trajectory = taped->run();
    if (trajectory.status == Status::success)
        trajectory.pull_back = [taped](const std::vector<double>& seeds) { return taped->pull_back(seeds); };
    return trajectory;
}

Simulation::Simulation(const Machine& machine, const Inputs& inputs, const SimulateOptions& options)
    : machine_(machine),
      inputs_(inputs),
      options_(options),
      layout_(machine_, inputs_),
      model_(machine_, inputs_, layout_),
      along_(machine_, inputs_, layout_),
      affine_(!effect_that_is_not_affine(machine_)) {
    read_options();
    read_parameters();
}

// Times at which something is known to break lie between cells; a cell's ends are evaluated from inside.
double Simulation::next_stop() {
    double stop = options_.end;
    if (next_break_ < breaks_.size()) stop = std::min(stop, breaks_[next_break_]);
    if (!delayed_breaks_.empty()) stop = std::min(stop, delayed_breaks_.top().t);
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        stop = std::min(stop, options_.start + static_cast<double>(ticks_[c]) * k.period);
        if (k.latency > 0 && outputs_[c] < ticks_[c])
            stop = std::min(stop, options_.start + static_cast<double>(outputs_[c]) * k.period + k.latency);
    }
    return stop;
}

std::vector<double> Simulation::tolerances() const {
    std::vector<double> a(scale_.size());
    for (std::size_t k = 0; k < a.size(); ++k) a[k] = options_.rtol * scale_[k];
    return a;
}

void Simulation::restart() {
    const auto z = solver_->state();
    for (std::size_t k = 0; k < scale_.size(); ++k) scale_[k] = std::max(scale_[k], std::abs(z[k]));
    for (const double work : solver_->quadrature()) energy_scale_ = std::max(energy_scale_, std::abs(work));
    solver_->restart(solver_->time() == 0.0 && out_.statistics.restarts == 0 ? options_.start : solver_->time(),
                     tolerances(), options_.rtol * energy_scale_);
    ++out_.statistics.restarts;
    if (!solver_->finds_every_root()) watch(solver_->time(), z.data(), guard_begin_, slope_begin_);
}

Trajectory Simulation::run() {
    out_.elements = layout_.switches;
    out_.state_names = layout_.state_names;
    const std::size_t rows = options_.rows ? std::min(times_.size(), SimulateOptions::rows_per_block) : times_.size();
    out_.t.reserve(rows);
    out_.values.reserve(rows * recorded_.size());
    start();
    if (out_.status == Status::success) loop();
    finish();
    if (options_.rows) options_.rows(out_);
    out_rows_ = out_.t.size();
    return std::move(out_);
}

void Simulation::loop() {
    long steps = 0;
    double stalled_since = options_.start, paced_since = options_.start;
    while (solver_->time() < options_.end - instant(options_.end)) {
        record_until(solver_->time() + instant(solver_->time()));  // with the state itself, no interpolant
        if (out_.status != Status::success) return;
        const double stop = next_stop();
        const Solver::Outcome outcome = solver_->step(stop);
        if (outcome == Solver::Outcome::failed)
            return fail(failure(), bad_numbers_ ? Solver::not_finite : solver_->failure().advice);
        if (++steps > options_.max_steps)
            return fail(Status::too_many_steps, "more than max_steps = " + std::to_string(options_.max_steps) +
                                                    " steps; raise it, shorten the run, or use a larger rtol");
        if (steps % interrupt_period == 0 && stop_now()) return;
        const std::vector<int> fallen = fallen_guards(outcome);
        const double t = solver_->time();
        if (steps % stall_period == 0) {
            if (t - stalled_since < stall_progress * (options_.end - options_.start))
                return fail(
                    Status::step_too_small,
                    "no headway: " + std::to_string(stall_period) + " steps for " + text(t - stalled_since) +
                        " s; try method = bdf, a larger rtol, or look for a gain or stiffness that is far too large");
            stalled_since = t;
        }
        if (steps % pace_period == 0) {
            const double needed =
                static_cast<double>(steps) + static_cast<double>(pace_period) * (options_.end - t) / (t - paced_since);
            if (needed > pace_doubt * static_cast<double>(options_.max_steps))
                return fail(Status::too_many_steps,
                            "at this pace some " + text(needed) +
                                " steps to the end, max_steps = " + std::to_string(options_.max_steps) +
                                "; look for a gain, stiffness or frequency that is far too large, shorten the run, "
                                "or raise max_steps");
            paced_since = t;
        }
        record_until(t - instant(t));
        if (history_) remember(solver_->previous_time(), t);
        if (!fallen.empty()) switch_at(fallen);
        if (out_.status != Status::success) return;
        if (t >= stop - instant(t)) pass_break();
        if (out_.status != Status::success) return;
    }
    record_until(options_.end + instant(options_.end));
}

bool Simulation::stop_now() {
    if (!options_.interrupted || !options_.interrupted()) return false;
    fail(Status::interrupted, "stopped on request; what was computed before is kept");
    return true;
}

Status Simulation::failure() const {
    if (bad_numbers_) return Status::not_finite;
    return solver_->failure().step_vanished ? Status::step_too_small : Status::solver_failure;
}

void Simulation::fail(Status status, const std::string& message) {
    out_.status = status;
    out_.message = "at t = " + text(solver_ ? solver_->time() : options_.start) + " s: " + message;
}

}  // namespace dualdrive
