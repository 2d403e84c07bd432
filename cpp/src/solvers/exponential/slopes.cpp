// Forward sensitivities behind the face of the solver.
#include <algorithm>

#include "exponential.hpp"

namespace dualdrive {

using exponential::Sensitivities;

// Beside a step that the states were taken over; what that errs by, of what is allowed.
double Exponential::sensitivities_over_step() {
    const Sensitivities::Found found = forward_->sensitivities.over(
        {&propagators(), now_->slopes.get(), setup_.cell, level_, origin_, column(0)}, atol_);
    finite_ = found.finite;
    if (!found.undriven.empty()) {
        driven_.insert(driven_.end(), found.undriven.begin(), found.undriven.end());
        std::sort(driven_.begin(), driven_.end());
        more_driven_ = true;
    }
    return found.error;
}

// Those at the present time, which a step leaves till someone asks.
void Exponential::bring_sensitivities() const {
    if (!forward_ || forward_->t == t_) return;
    if (taken_) forward_->sensitivities.bring(t_);
    forward_->t = t_;
}

std::span<double> Exponential::sensitivity(int k) {
    bring_sensitivities();
    return forward_->sensitivities.now(k);
}

// Of all parameters within the step that was taken, (s, c) of each.
const double* Exponential::sensitivities_at(double t) const { return forward_->sensitivities.at(t); }

void Exponential::sensitivity_at(double t, int k, double* s) const {
    if (t == t_ || !taken_) {
        bring_sensitivities();
        const auto now = forward_->sensitivities.now(k);
        std::copy(now.begin(), now.end(), s);
        return;
    }
    std::copy_n(sensitivities_at(t) + static_cast<std::size_t>(k) * forward_->sensitivities.apart(), states_, s);
}

// C s + (∂C/∂p) y where the recorded signals are C y.
bool Exponential::signal_slopes_at(double t, double* slopes) const {
    if (!taken_ || !now_ || now_->outputs.rows.size() == 0) return false;
    const auto& [C, changes] = now_->outputs;
    const double* const s = sensitivities_at(t);
    const std::size_t apart = forward_->sensitivities.apart(), count = changes.size();
    using Slope = Eigen::Map<const Eigen::VectorXd>;
    const auto n = static_cast<Eigen::Index>(states_);
    const double* const y = at(t);
    for (std::size_t k = 0; k < count; ++k) {
        const Eigen::VectorXd own = C.leftCols(n) * Slope(s + k * apart, n);
        for (Eigen::Index r = 0; r < own.size(); ++r) slopes[static_cast<std::size_t>(r) * count + k] = own[r];
        for (const auto& e : changes[k]) slopes[static_cast<std::size_t>(e.row) * count + k] += e.value * y[e.column];
    }
    return true;
}

}  // namespace dualdrive
