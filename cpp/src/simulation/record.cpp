// What a run leaves behind: outputs, sensitivities, the past of delayed signals, statistics.
#include <algorithm>
#include <cmath>
#include <limits>

#include "instant.hpp"
#include "simulation.hpp"

namespace dualdrive {

namespace {

void hand_over(Trajectory& out, const std::function<void(const Trajectory&)>& rows) {
    rows(out);
    out.t.clear();
    out.modes.clear();
    for (auto* recorded : {&out.values, &out.work, &out.sensitivities}) recorded->clear();
}

}  // namespace

void Simulation::record_until(double t) {
    while (out_.status == Status::success && next_output_ < times_.size() && times_[next_output_] <= t) {
        const std::size_t room = options_.rows ? SimulateOptions::rows_per_block - out_.t.size() : times_.size();
        std::size_t due = 1;
        while (due < room && next_output_ + due < times_.size() && times_[next_output_ + due] <= t) ++due;
        record({times_.data() + next_output_, due});
        next_output_ += due;
        if (options_.rows && out_.t.size() == SimulateOptions::rows_per_block) hand_over(out_, options_.rows);
    }
}

// The recorded signals and all that goes with them, for times within the last step.
void Simulation::record(std::span<const double> times) {
    const std::size_t first = out_.t.size(), width = recorded_.size();
    out_.values.resize((first + times.size()) * width);
    double* const values = out_.values.data() + first * width;
    if (!solver_->signals_at(times, values))
        for (std::size_t k = 0; k < times.size(); ++k) {
            record_by_model(times[k], all_, values + k * width);
            if (exponential_) write_output(times[k]);
        }
    else if (!curved_.empty())
        for (std::size_t k = 0; k < times.size(); ++k) record_by_model(times[k], curved_, values + k * width);
    const std::size_t rows = finite_rows(times.size());
    out_.values.resize((first + rows) * width);
    for (const double t : times.first(rows)) {
        out_.t.push_back(t);
        out_.modes.insert(out_.modes.end(), modes_.begin(), modes_.end());
        if (options_.energy) record_work(t);
        if (!parameters_.empty()) record_sensitivities(t, out_.t.size() - 1);
    }
    if (rows < times.size()) fail(Status::not_finite, Solver::not_finite);
}

// Some of the recorded signals, as the model has them.
void Simulation::record_by_model(double t, const std::vector<std::size_t>& which, double* row) {
    solver_->state_at(t, z_scratch_.data());
    if (placed_) {
        model_.place(z_scratch_.data());
        evaluated_.t = std::numeric_limits<double>::quiet_NaN();
    } else {
        evaluate(t, z_scratch_.data());
    }
    for (const std::size_t k : which) row[k] = model_.signals()[static_cast<std::size_t>(recorded_[k])];
}

// How many of the last rows are all numbers.
std::size_t Simulation::finite_rows(std::size_t rows) const {
    const std::size_t width = recorded_.size(), first = out_.values.size() - rows * width;
    double sums[4] = {};  // of zeros, unless a value is not finite; four, lest each addition waits for the one before
    std::size_t k = first;
    for (; k + 4 <= out_.values.size(); k += 4)
        for (std::size_t j = 0; j < 4; ++j) sums[j] += 0.0 * out_.values[k + j];
    for (; k < out_.values.size(); ++k) sums[0] += 0.0 * out_.values[k];
    if (sums[0] + sums[1] + sums[2] + sums[3] == 0.0) return rows;
    const auto begin = out_.values.begin() + static_cast<std::ptrdiff_t>(first);
    const auto bad = std::find_if(begin, out_.values.end(), [](double v) { return !std::isfinite(v); });
    return static_cast<std::size_t>(bad - begin) / width;
}

void Simulation::record_work(double t) {
    solver_->quadrature_at(t, work_scratch_.data());
    out_.work.insert(out_.work.end(), work_scratch_.begin(), work_scratch_.end());
    const double stored = stored_energy(t);
    double work = 0.0;
    for (const double w : work_scratch_) {
        work += w;
        energy_moved_ = std::max(energy_moved_, std::abs(w));
    }
    energy_moved_ = std::max(energy_moved_, std::abs(stored));
    energy_worst_ = std::max(energy_worst_, std::abs(stored - energy_start_ - work));
}

double Simulation::stored_energy(double t) {
    if (const auto known = solver_->stored_energy_at(t)) return *known;
    solver_->state_at(t, z_scratch_.data());
    evaluate(t, z_scratch_.data());
    return model_.signals()[static_cast<std::size_t>(layout_.at.stored_energy)];
}

void Simulation::record_sensitivities(double t, std::size_t row) {
    const std::size_t width = recorded_.size() * parameters_.size();
    out_.sensitivities.resize((row + 1) * width);
    if (curved_.empty() && solver_->signal_slopes_at(t, out_.sensitivities.data() + row * width)) return;
    solver_->state_at(t, z_scratch_.data());
    std::vector<std::vector<double>> s(parameters_.size(), std::vector<double>(z_along_.size()));
    for (std::size_t k = 0; k < parameters_.size(); ++k) solver_->sensitivity_at(t, static_cast<int>(k), s[k].data());
    for (std::size_t c = 0; c < chunks(); ++c) {
        evaluate_chunk(c, t, z_scratch_.data(), [&](std::size_t k, std::size_t state) { return s[k][state]; });
        for (std::size_t r = 0; r < recorded_.size(); ++r)
            for (std::size_t d = 0; d < directions && c * directions + d < parameters_.size(); ++d)
                out_.sensitivities[row * width + r * parameters_.size() + c * directions + d] =
                    chunk_[c]->signals()[static_cast<std::size_t>(recorded_[r])].slope[d];
    }
}

// The last step becomes past: delayed signals are sampled from the solver's own interpolant.
void Simulation::remember(double from, double to) {
    if (to - from < instant(to)) return;
    const std::size_t lines = layout_.delays.size(), np = parameters_.size();
    std::vector<double> samples(History::points * lines), slopes(History::points * lines * np);
    for (int j = 0; j < History::points; ++j) {
        const double t = history_->node(j, from, to);
        solver_->state_at(t, z_scratch_.data());
        evaluate(t, z_scratch_.data());
        for (std::size_t l = 0; l < lines; ++l)
            samples[static_cast<std::size_t>(j) * lines + l] =
                model_.signals()[static_cast<std::size_t>(layout_.delays[l].source)];
        if (np == 0) continue;
        std::vector<std::vector<double>> s(np, std::vector<double>(z_along_.size()));
        for (std::size_t k = 0; k < np; ++k) solver_->sensitivity_at(t, static_cast<int>(k), s[k].data());
        for (std::size_t c = 0; c < chunks(); ++c) {
            evaluate_chunk(c, t, z_scratch_.data(), [&](std::size_t k, std::size_t state) { return s[k][state]; });
            for (std::size_t l = 0; l < lines; ++l)
                for (std::size_t d = 0; d < directions && c * directions + d < np; ++d)
                    slopes[(static_cast<std::size_t>(j) * lines + l) * np + c * directions + d] =
                        chunk_[c]->signals()[static_cast<std::size_t>(layout_.delays[l].source)].slope[d];
        }
    }
    history_->append(from, to, samples, slopes);
    double longest = 0.0;
    for (const auto& d : layout_.delays) longest = std::max(longest, machine_.values()[d.slot]);
    history_->forget_before(to - 1.01 * longest - 1e-9);
}

void Simulation::finish() {
    if (!solver_) return;
    out_.statistics.method = solver_->name();
    const auto c = solver_->counts();
    out_.statistics.steps = c.steps;
    out_.statistics.rhs = c.rhs;
    out_.statistics.jacobians = c.jacobians;
    out_.statistics.guards = c.guards;
    out_.statistics.error_test_failures = c.error_test_failures;
    out_.statistics.energy_error = energy_moved_ > 0 ? energy_worst_ / energy_moved_ : 0.0;
    out_.final_state.assign(solver_->state().begin(), solver_->state().end());
}

}  // namespace dualdrive
