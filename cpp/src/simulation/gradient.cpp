// The gradient of a cost: what a run leaves on its tape, and the walk back over it.
#include <stdexcept>

#include "../solvers/exact/adjoint.hpp"
#include "../solvers/exponential/adjoint.hpp"
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

Place Simulation::here() const {
    const auto z = solver_->state();
    return {solver_->time(), {z.begin(), z.end()}, modes_, cell_};
}

void Simulation::write_jump(JumpKind kind, const Clock* clock) {
    tape_->add({.kind = Entry::Kind::jump, .count = static_cast<int>(jumps_.size())});
    jumps_.push_back({kind, clock, here()});
}

// A guard falls at the present instant, in the modes as they are, at `rate` per s.
void Simulation::write_instant(int guard, double rate) {
    if (exact_) return exact_->write_instant(guard, rate);
    tape_->add(
        {.kind = Entry::Kind::instant, .count = guard, .place = static_cast<int>(places_.size()), .length = rate});
    places_.push_back(here());
}

// A row was recorded from the state in z_scratch_.
void Simulation::write_output(double t) {
    tape_->add_reading(static_cast<int>(places_.size()), exponential_->fresh());
    places_.push_back({t, z_scratch_, modes_, cell_});
}

// λ⁻ = (∂h/∂z)ᵀ λ⁺, and λ⁺ᵀ ∂h/∂p is owed to the parameters.
void Simulation::jump_back(const Jump& jump, double* lambda, Pullback& pullback) const {
    TracedParameters& parameters = pullback.parameters();
    parameters.begin();
    const std::size_t first = pullback.evaluate(jump.at);
    std::vector<Traced> next(pullback.state());
    do_jump(jump.kind, jump.clock, pullback.model(), pullback.state().data(), next.data());
    for (std::size_t i = 0; i < next.size(); ++i) parameters.weigh(next[i], lambda[i]);
    parameters.walk_back();
    for (std::size_t i = 0; i < next.size(); ++i) lambda[i] = parameters.owed(first + i);
}

namespace {

void add(std::vector<double>& sum, const std::vector<double>& what) {
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += what[k];
}

}  // namespace

// What the exact engine's laws owe to parameters; λ of the start besides.
std::vector<double> Simulation::walk_back(exact::Adjoint& adjoint, const double* seeds,
                                          std::vector<double>& gradient) const {
    adjoint.walk(seeds, recorded_.size());
    for (const auto& owed : adjoint.laws()) {
        const auto derivatives = exact_->derivatives(owed->law, back_slots());
        for (std::size_t k = 0; k < gradient.size(); ++k) gradient[k] += owed->gradient.along(derivatives[k]);
    }
    return adjoint.lambda();
}

// What the exponential engine's tangents, and signals where they are affine, owe to parameters.
std::vector<double> Simulation::walk_back(exponential::Adjoint& adjoint, const double* seeds,
                                          std::vector<double>& gradient) const {
    adjoint.walk(seeds, recorded_.size());
    TracedParameters parameters(machine_, back_slots());
    exact::Reader<Traced> reader(machine_, inputs_, layout_, exponential_->generator(), recorded_);
    reader.set_parameters(parameters.values());
    parameters.keep_trace();
    const auto rows = static_cast<Eigen::Index>(exact::padded(layout_.size()));
    for (const auto& known : adjoint.tangents()) {
        parameters.begin();
        const exponential::Tangent& at = *known->tangent;
        const exact::Laws<Traced> laws = reader.tangent(at.modes, at.t, at.z.data());
        const std::vector<double>& total = known->gradient.total();
        for (Eigen::Index c = 0; c < laws.A.cols(); ++c) {
            for (Eigen::Index r = 0; r < layout_.size(); ++r)
                parameters.weigh(laws.A(r, c), total[static_cast<std::size_t>(c * rows + r)]);
            for (Eigen::Index s = 0; s < known->outputs_owed.rows(); ++s)
                parameters.weigh(laws.outputs(s, c), known->outputs_owed(s, c));
        }
        parameters.walk_back();
    }
    add(gradient, parameters.owed_to_parameters());
    return adjoint.lambda();
}

TracedParameters::Slots Simulation::back_slots() const {
    TracedParameters::Slots slots;
    for (const Parameter& p : back_parameters_) slots.push_back(p.slots);
    return slots;
}

std::vector<double> Simulation::pull_back(const std::vector<double>& seeds) const {
    const std::size_t rows = out_rows_, wanted = rows * recorded_.size();
    if (seeds.size() != wanted)
        throw std::invalid_argument("gradient: " + std::to_string(seeds.size()) + " derivatives for " +
                                    std::to_string(rows) + " times x " + std::to_string(recorded_.size()) +
                                    " signals; give one per recorded value");
    std::vector<double> gradient(back_parameters_.size(), 0.0), lambda;
    Pullback pullback(machine_, inputs_, layout_, back_slots());
    const auto over_jump = [&](int jump, double* at) {
        jump_back(jumps_[static_cast<std::size_t>(jump)], at, pullback);
    };
    if (exact_) {
        exact::Adjoint adjoint(*tape_, layout_.size(), over_jump);
        lambda = walk_back(adjoint, seeds.data(), gradient);
    } else {
        exact::Reader<double> reader(machine_, inputs_, layout_, exponential_->generator(), recorded_);
        const auto outputs = [&](const exponential::Tangent& at) -> exact::Matrix<double> {
            if (!steps_->bent.spare(recorded_, at.modes, at.t, at.z.data())) return {};
            return reader.tangent(at.modes, at.t, at.z.data()).outputs;
        };
        exponential::Adjoint adjoint(*tape_, layout_.size(), over_jump,
                                     {steps_->taken, places_, exponential_->generator(), recorded_, pullback, outputs});
        lambda = walk_back(adjoint, seeds.data(), gradient);
    }
    add(gradient, pullback.parameters().owed_to_parameters());
    for (std::size_t k = 0; k < gradient.size(); ++k)
        if (const int state = back_parameters_[k].initial_state; state >= 0)
            gradient[k] += lambda[static_cast<std::size_t>(state)];
    return gradient;
}

}  // namespace dualdrive
