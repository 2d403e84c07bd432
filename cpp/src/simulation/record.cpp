// What a run leaves behind: outputs, sensitivities, the past of delayed signals, statistics.
#include <algorithm>
#include <cmath>

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
        solver_->state_at(times_[next_output_], z_scratch_.data());
        record(times_[next_output_], z_scratch_.data());
        ++next_output_;
        if (options_.rows && out_.t.size() == SimulateOptions::rows_per_block) hand_over(out_, options_.rows);
    }
}

// The recorded signals as one row more.
bool Simulation::record_signals(double t, const double* z) {
    const std::size_t first = out_.values.size();
    out_.values.resize(first + recorded_.size());
    double* row = out_.values.data() + first;
    const auto from_model = [&](std::size_t k) { row[k] = model_.signals()[static_cast<std::size_t>(recorded_[k])]; };
    const bool known = solver_->signals_at(t, row);
    if (!known || !curved_.empty()) evaluate(t, z);
    if (known)
        std::for_each(curved_.begin(), curved_.end(), from_model);
    else
        for (std::size_t k = 0; k < recorded_.size(); ++k) from_model(k);
    if (std::all_of(out_.values.begin() + static_cast<std::ptrdiff_t>(first), out_.values.end(),
                    [](double v) { return std::isfinite(v); }))
        return true;
    out_.values.resize(first);
    fail(Status::not_finite, Solver::not_finite);
    return false;
}

void Simulation::record(double t, const double* z) {
    if (!record_signals(t, z)) return;
    out_.t.push_back(t);
    out_.modes.insert(out_.modes.end(), modes_.begin(), modes_.end());
    if (options_.energy) {
        solver_->quadrature_at(t, work_scratch_.data());
        out_.work.insert(out_.work.end(), work_scratch_.begin(), work_scratch_.end());
        const double stored = stored_energy(t, z);
        double work = 0.0;
        for (const double w : work_scratch_) {
            work += w;
            energy_moved_ = std::max(energy_moved_, std::abs(w));
        }
        energy_moved_ = std::max(energy_moved_, std::abs(stored));
        energy_worst_ = std::max(energy_worst_, std::abs(stored - energy_start_ - work));
    }
    if (!parameters_.empty()) record_sensitivities(t, z, out_.t.size() - 1);
}

double Simulation::stored_energy(double t, const double* z) {
    if (const auto known = solver_->stored_energy_at(t)) return *known;
    evaluate(t, z);
    return model_.signals()[static_cast<std::size_t>(layout_.at.stored_energy)];
}

void Simulation::record_sensitivities(double t, const double* z, std::size_t row) {
    const std::size_t width = recorded_.size() * parameters_.size();
    out_.sensitivities.resize((row + 1) * width);
    if (curved_.empty() && solver_->signal_slopes_at(t, out_.sensitivities.data() + row * width)) return;
    std::vector<std::vector<double>> s(parameters_.size(), std::vector<double>(z_along_.size()));
    for (std::size_t k = 0; k < parameters_.size(); ++k) solver_->sensitivity_at(t, static_cast<int>(k), s[k].data());
    for (std::size_t c = 0; c < chunks(); ++c) {
        evaluate_chunk(c, t, z, [&](std::size_t k, std::size_t state) { return s[k][state]; });
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
    for (const auto& d : layout_.delays)
        longest = std::max(
            longest, d.effect >= 0 ? machine_.values()[machine_.effects()[static_cast<std::size_t>(d.effect)].first]
                                   : machine_.get("controller.delta_t"));
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
