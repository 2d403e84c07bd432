// The gradient of a cost: jumps on the tape of a run, and the walk back over it.
#include <stdexcept>

#include "../solvers/exact/adjoint.hpp"
#include "simulation.hpp"

namespace dualdrive {

// What a jump makes of z, by the model as it was evaluated there; `next` starts as a copy of z.
template <class S>
void Simulation::do_jump(JumpKind kind, const Clock* clock, const Model<S>& model, const S* z, S* next) const {
    switch (kind) {
        case JumpKind::riding:
            return model.slave_integrators(next);
        case JumpKind::tick:
            return model.tick(*clock, next);
        case JumpKind::output:
            return model.put_out(*clock, z, next);
        case JumpKind::encoders:  // start with the motors' angles, which follow from ratios and initial states
            for (std::size_t m = 0; m < layout_.encoder_history.size(); ++m) {
                const auto body = static_cast<std::size_t>(machine_.motors()[m].body);
                for (int h = 0; h < machine_.controller().speed_samples; ++h)
                    next[layout_.encoder_history[m] + h] =
                        model.signals()[static_cast<std::size_t>(layout_.at.angle[body])];
            }
            return;
    }
}

template void Simulation::do_jump(JumpKind, const Clock*, const Model<double>&, const double*, double*) const;
template void Simulation::do_jump(JumpKind, const Clock*, const Model<Gradient>&, const Gradient*, Gradient*) const;

void Simulation::write_jump(JumpKind kind, const Clock* clock) {
    const auto z = solver_->state();
    tape_->add({.kind = exact::Entry::Kind::jump, .count = static_cast<int>(jumps_.size())});
    jumps_.push_back({kind, clock, solver_->time(), {z.begin(), z.end()}, modes_, cell_});
}

// λ⁻ = (∂h/∂z)ᵀ λ⁺, and λ⁺ᵀ ∂h/∂p into the gradient.
void Simulation::jump_back(int number, double* lambda, std::vector<double>& gradient) {
    const Jump& jump = jumps_[static_cast<std::size_t>(number)];
    const std::size_t n = jump.z.size();
    std::vector<Gradient> z(jump.z.begin(), jump.z.end()), next;
    const auto weigh = [&](std::size_t d) {
        double sum = 0.0;
        for (std::size_t i = 0; i < n; ++i) sum += lambda[i] * next[i].slope[d];
        return sum;
    };
    const auto evaluate = [&](Model<Gradient>& model) {
        model.evaluate(Gradient(jump.t), z.data(), {jump.modes.data(), jump.cell, nullptr, nullptr});
        next = z;
        do_jump(jump.kind, jump.clock, model, z.data(), next.data());
    };
    std::vector<double> back(n);
    for (std::size_t first = 0; first < n; first += directions) {
        const std::size_t last = std::min<std::size_t>(first + directions, n);
        for (std::size_t k = first; k < last; ++k) z[k].slope[k - first] = 1.0;
        evaluate(along_);
        for (std::size_t k = first; k < last; ++k) {
            back[k] = weigh(k - first);
            z[k].slope[k - first] = 0.0;
        }
    }
    for (std::size_t c = 0; c < back_models_.size(); ++c) {
        evaluate(*back_models_[c]);
        for (std::size_t d = 0; d < directions && c * directions + d < gradient.size(); ++d)
            gradient[c * directions + d] += weigh(d);
    }
    std::copy(back.begin(), back.end(), lambda);
}

std::vector<double> Simulation::pull_back(const std::vector<double>& seeds) {
    const std::size_t rows = out_rows_, wanted = rows * recorded_.size();
    if (seeds.size() != wanted)
        throw std::invalid_argument("gradient: " + std::to_string(seeds.size()) + " derivatives for " +
                                    std::to_string(rows) + " times x " + std::to_string(recorded_.size()) +
                                    " signals; give one per recorded value");
    std::vector<double> gradient(back_parameters_.size(), 0.0);
    if (back_models_.empty()) back_models_ = seeded_models(back_parameters_);
    exact::Adjoint adjoint(*tape_, layout_.size(),
                           [&](int jump, double* lambda) { jump_back(jump, lambda, gradient); });
    adjoint.walk(seeds.data(), recorded_.size());
    std::vector<std::vector<std::size_t>> slots;
    for (const Parameter& p : back_parameters_) slots.push_back(p.slots);
    for (auto& [law, owed] : adjoint.laws()) {
        const auto derivatives = exact_->derivatives(law, slots);
        for (std::size_t k = 0; k < gradient.size(); ++k) gradient[k] += owed.along(derivatives[k]);
    }
    for (std::size_t k = 0; k < gradient.size(); ++k)
        if (const int state = back_parameters_[k].initial_state; state >= 0)
            gradient[k] += adjoint.lambda()[static_cast<std::size_t>(state)];
    return gradient;
}

}  // namespace dualdrive
