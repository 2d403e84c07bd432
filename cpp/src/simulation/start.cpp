// The start of a run: typical sizes, modes, what lies before it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "instant.hpp"
#include "simulation.hpp"

namespace dualdrive {

// Typical sizes from energy: the play's energy, the commanded motion's, the initial state's. They grow with what is seen.
void Simulation::start() {
    const std::size_t n = static_cast<std::size_t>(layout_.size());
    z_scratch_.assign(n, 0.0);
    rate_scratch_.assign(n, 0.0);
    block_rate_.assign(layout_.blocks.size(), 0.0);
    work_scratch_.assign(powers, 0.0);
    z_along_.assign(n, Gradient(0.0));
    ticks_.assign(layout_.clocks.size(), 0);
    outputs_.assign(layout_.clocks.size(), 0);
    for (const auto& [name, value] : options_.initial)
        z_scratch_[static_cast<std::size_t>(layout_.state(name))] = value;
    double rate = 0.0, reach = 0.0;
    for (const auto& [name, w] : inputs_) {
        const std::vector<double> breaks = w.breaks();
        breaks_.insert(breaks_.end(), breaks.begin(), breaks.end());
        if (name != "theta_ref") continue;
        for (int k = 0; k <= 200; ++k) {
            const double t = options_.start + (options_.end - options_.start) * k / 200.0;
            rate = std::max(rate, std::abs(w.rate(t)));
            reach = std::max(reach, std::abs(w.value(t)));
        }
    }
    model_.instants(breaks_);
    std::erase_if(breaks_, [&](double b) { return !(b > options_.start + instant(b) && b < options_.end); });
    std::sort(breaks_.begin(), breaks_.end());
    breaks_.erase(std::unique(breaks_.begin(), breaks_.end()), breaks_.end());

    // What happened before the start: inputs as they stood, delayed signals at their value then.
    cell_ = {options_.start - 1.0, options_.start};
    modes_.assign(layout_.switches.size(), 0);
    loose_since_.assign(modes_.size(), -std::numeric_limits<double>::infinity());
    for (std::size_t e = 0; e < modes_.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::branch) modes_[e] = branch::positive;
    classify();
    evaluate(options_.start, z_scratch_.data());
    for (std::size_t k = 0; k < layout_.encoder_history.size(); ++k)
        for (int h = 0; h < machine_.controller().speed_samples; ++h)
            z_scratch_[static_cast<std::size_t>(layout_.encoder_history[k] + h)] =
                model_.signals()[static_cast<std::size_t>(
                    layout_.at.angle[static_cast<std::size_t>(machine_.motors()[k].body)])];
    if (layout_.derivative_filter >= 0 && options_.initial.count("controller.derivative") == 0)
        z_scratch_[static_cast<std::size_t>(layout_.derivative_filter)] = 0.0;  // z(0) = 0: a step kicks by K_d/τ_d
    const auto seed = [&](std::size_t k, std::size_t state) {  // initial sensitivities, but for the encoders'
        return parameters_[k].initial_state == static_cast<int>(state) ? 1.0 : 0.0;
    };
    if (!layout_.delays.empty()) {
        history_ = std::make_unique<History>(options_.start, layout_.delays.size(), parameters_.size());
        for (std::size_t d = 0; d < layout_.delays.size(); ++d)
            history_->set_before(d, model_.signals()[static_cast<std::size_t>(layout_.delays[d].source)]);
        past_ = std::make_unique<HistoryView<double>>(*history_, -1);
        past_along_ = std::make_unique<HistoryView<Gradient>>(*history_, -1);
        for (std::size_t c = 0; c < chunks(); ++c) {
            evaluate_chunk(c, options_.start, z_scratch_.data(), seed);
            for (std::size_t d = 0; d < layout_.delays.size(); ++d)
                for (std::size_t k = c * directions; k < std::min((c + 1) * directions, parameters_.size()); ++k)
                    history_->set_slope_before(d, k,
                                               chunk_[c]
                                                   ->signals()[static_cast<std::size_t>(layout_.delays[d].source)]
                                                   .slope[k - c * directions]);
        }
        for (std::size_t c = 0; c < chunks(); ++c)
            past_chunk_.push_back(std::make_unique<HistoryView<Gradient>>(*history_, static_cast<int>(c * directions)));
    }

    double energy = std::abs(model_.signals()[static_cast<std::size_t>(layout_.at.stored_energy)]);
    double inertia = 0.0;
    for (int g = 0; g < layout_.groups; ++g) inertia = std::max(inertia, model_.group_inertia(g));
    energy = std::max(energy, 1e-4 * 0.5 * inertia * rate * rate);
    for (const auto& c : machine_.connections()) {
        const auto p = read_component<Connection<double>>(machine_.values().data() + c.first);
        if (c.kind != ConnectionKind::rigid) energy = std::max(energy, 1e-4 * 0.5 * p.stiffness * p.gap * p.gap);
    }
    energy_scale_ = energy = std::max(energy, 1e-12 * std::max(1.0, inertia));
    scale_.assign(n, 1e-9);
    for (int g = 0; g < layout_.groups; ++g)
        scale_[static_cast<std::size_t>(g)] = std::sqrt(2.0 * energy / std::max(model_.group_inertia(g), 1e-12));
    for (std::size_t c = 0; c < layout_.twist.size(); ++c) {
        if (layout_.twist[c] < 0) continue;
        const auto p = read_component<Connection<double>>(machine_.values().data() + machine_.connections()[c].first);
        scale_[static_cast<std::size_t>(layout_.twist[c])] =
            std::max(p.gap, 1e-3 * std::sqrt(2.0 * energy / p.stiffness));
    }
    for (const int a : layout_.root_angle)
        scale_[static_cast<std::size_t>(a)] = std::max({1e-6, 1e-3 * reach, scale_[0] * 1e-2});
    for (std::size_t k = 0; k < layout_.current.size(); ++k) {
        if (layout_.current[k] < 0) continue;
        const auto m = read_component<Motor<double>>(machine_.values().data() + machine_.motors()[k].first);
        const double torque = std::isfinite(m.T_rated) ? m.T_rated : std::isfinite(m.T_max) ? m.T_max : 1.0;
        scale_[static_cast<std::size_t>(layout_.current[k])] = 0.1 * torque / m.K_d;
    }
    for (std::size_t k = 0; k < layout_.set_point_filter.size(); ++k) {
        if (layout_.set_point_filter[k] < 0) continue;
        const auto m = read_component<Motor<double>>(machine_.values().data() + machine_.motors()[k].first);
        const double torque = std::isfinite(m.T_rated) ? m.T_rated : std::isfinite(m.T_max) ? m.T_max : 1.0;
        for (int s = 0; s < 2; ++s) scale_[static_cast<std::size_t>(layout_.set_point_filter[k] + s)] = 0.1 * torque;
    }
    for (std::size_t b = 0; b < layout_.blocks.size(); ++b)
        if (const int s = layout_.blocks[b].integrator; s >= 0) {
            const auto& block = model_.block(static_cast<int>(b));
            const double full = block.limit / block.gain;
            scale_[static_cast<std::size_t>(s)] = std::isfinite(full) ? 0.01 * full : 1e-6;
        }

    const std::size_t guards = layout_.switches.size() * guards_per_switch;
    for (auto* g : {&guard_begin_, &guard_end_, &guard_probe_}) g->assign(guards, 1.0);
    for (auto* slope : {&slope_begin_, &slope_end_}) slope->assign(guards, 0.0);
    std::vector<double> parameter_scale;
    for (const auto& p : parameters_) parameter_scale.push_back(p.scale);
    choose_solver(static_cast<int>(guards), parameter_scale);
    guard_inside_.assign(static_cast<std::size_t>(solver_->looks()), std::vector<double>(guards, 1.0));
    std::copy(z_scratch_.begin(), z_scratch_.end(), solver_->state().begin());
    for (std::size_t k = 0; k < parameters_.size(); ++k)
        for (std::size_t state = 0; state < n; ++state)
            solver_->sensitivity(static_cast<int>(k))[state] = seed(k, state);
    if (!layout_.encoder_history.empty()) apply(JumpKind::encoders);
    constexpr double unlimited = std::numeric_limits<double>::infinity();
    double longest = options_.longest_step > 0 ? options_.longest_step : unlimited;
    for (const auto& d : layout_.delays) {  // the past must lie behind the step
        const double delay = machine_.values()[d.slot];
        if (delay < 1e-7)
            throw std::invalid_argument(d.name + ": " + text(delay) +
                                        " s is too short to integrate as a delay; use 0 or at least 1e-7 s");
        longest = std::min(longest, 0.99 * delay);
    }
    // A machine at rest would stride over a command that comes and goes.
    solver_->limit_step(longest, turning_time());
    restart();
    pass_break();
    evaluate(options_.start, solver_->state().data());
    energy_start_ = model_.signals()[static_cast<std::size_t>(layout_.at.stored_energy)];
}

}  // namespace dualdrive
