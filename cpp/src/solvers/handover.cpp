#include "handover.hpp"

#include <algorithm>

namespace dualdrive {

void Handover::restart(double t, std::span<const double> atol, double quadrature_atol) {
    atol_.assign(atol.begin(), atol.end());
    quadrature_atol_ = quadrature_atol;
    now().restart(t, atol, quadrature_atol);
}

void Handover::limit_step(double longest, double turning) {
    longest_ = longest;
    turning_ = turning;
    now().limit_step(longest, turning);
}

Solver::Outcome Handover::step(double stop) {
    if (!stiff_ && mild_->stiff()) hand_over();
    return now().step(stop);
}

void Handover::hand_over() {
    auto stiff = make_stiff_();
    std::ranges::copy(mild_->state(), stiff->state().begin());
    std::ranges::copy(mild_->quadrature(), stiff->quadrature().begin());
    for (int k = 0; k < mild_->sensitivities(); ++k)
        std::ranges::copy(mild_->sensitivity(k), stiff->sensitivity(k).begin());
    stiff->limit_step(longest_, turning_);
    stiff->restart(mild_->time(), atol_, quadrature_atol_);
    stiff_ = std::move(stiff);
}

Solver::Counts Handover::counts() const {
    const Counts a = mild_->counts(), b = stiff_ ? stiff_->counts() : Counts{};
    return {a.steps + b.steps, a.rhs + b.rhs, a.jacobians + b.jacobians, a.guards + b.guards,
            a.error_test_failures + b.error_test_failures};
}

}  // namespace dualdrive
