// Laws that are not affine, between samples: ẏ = A y + B n(t, y), A the tangent in the present modes and B a column of one for
// each rate on which they act.
//
// Exponential Adams method of order 3 in its form PEC (Hochbruck, Ostermann, Acta Numerica 19 (2010) 209–286, §2.6): n is
// predicted by a straight line through its values at the beginning and a step before, evaluated once where that leads, and the
// parabola through all three serves the step. The first step in a tangent has no step before: there it is predicted as
// constant, and a straight line serves.
#include <cmath>

#include "../solvers/exact/kernels.hpp"
#include "dense.hpp"
#include "dualdrive/effects.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

// Of what is felt by the plant alone, speeds, currents and the laws' own states; else all but what follows from speeds by
// geometry.
std::vector<int> Flow::driven_rows() const {
    if (affine_) return {};
    std::vector<bool> driven(static_cast<std::size_t>(states()), scope_ == Scope::whole);
    const auto set = [&](int state, bool to) {
        if (state >= 0) driven[static_cast<std::size_t>(state)] = to;
    };
    for (const int twist : layout_.twist) set(twist, false);
    for (const int angle : layout_.root_angle) set(angle, false);
    for (int g = 0; g < layout_.groups; ++g) set(g, !layout_.locked[static_cast<std::size_t>(g)]);
    for (std::size_t k = 0; k < layout_.current.size(); ++k)
        if (!layout_.effects_in_motor[k].empty()) set(layout_.current[k], true);
    for (const auto& memory : layout_.memories) {
        const int count = effect_type(machine_.effects()[static_cast<std::size_t>(memory.effect)].name).memory;
        for (int k = 0; k < count; ++k) set(memory.state + k, true);
    }
    std::vector<int> rows;
    for (int k = 0; k < states(); ++k)
        if (driven[static_cast<std::size_t>(k)]) rows.push_back(k);
    return rows;
}

// Those of control have nothing of the plant but by the states.
std::vector<int> Flow::watching_guards() const {
    std::vector<int> guards;
    for (int e = 0; e < static_cast<int>(layout_.switches.size()) && !affine_; ++e) {
        const Switch& s = layout_.switches[static_cast<std::size_t>(e)];
        const bool control =
            s.kind == SwitchKind::limiter || e == layout_.tension_sum_branch || e == layout_.tension_zero_branch;
        for (int which = 0; which < guards_per_switch && !(control && scope_ == Scope::plant); ++which)
            guards.push_back(e * guards_per_switch + which);
    }
    return guards;
}

std::vector<double> Flow::felt(const exact::Laws<double>& laws) const {
    Eigen::MatrixXd rows(static_cast<Eigen::Index>(driven_.size() + watching_.size()), laws.A.cols());
    Eigen::Index row = 0;
    for (const int k : driven_) rows.row(row++) = laws.A.row(k);
    for (const int k : watching_) rows.row(row++) = laws.guards.row(k);
    return packed_rows(rows);
}

// n, and what laws add to the tangent's guards, at (t, y).
void Flow::feel(double t, const double* y) {
    model_.evaluate(t, y, {modes_.data(), cell_, memory_.get(), nullptr, nullptr, scope_});
    exact::kernels().multiply(static_cast<int>(felt_.size()), first_torque(), now_->felt.data(), n_, y, 1,
                              felt_.data());
    double* rest = felt_.data();
    for (const int k : driven_) {
        *rest = model_.rate()[static_cast<std::size_t>(k)] - *rest;
        ++rest;
    }
    for (const int k : watching_) {
        *rest = model_.guard(k / guards_per_switch, k % guards_per_switch, nullptr) - *rest;
        ++rest;
    }
}

// Guards at a state near the one where laws were felt last, if there are any.
void Flow::guards_near(const double* y, double* g) const {
    const int rows = exact::padded(static_cast<int>(guard_count()));
    exact::kernels().multiply(rows, n_, now_->watched.data(), n_, y, 1, g);
    const double* rest = felt_.data() + driven_.size();
    for (const int k : watching_) g[k] += *rest++;
}

bool Flow::integrate(double t, const Step& step) {
    const std::size_t d = driven_.size();
    const auto rows = static_cast<int>(out_.size()), columns = static_cast<int>(d);
    double *const n = y_.data() + n_, *const change = n + d;
    const bool whole = &step == &now_->whole, goes_on = whole && along_ == now_;
    if (rest_of_ != now_) {
        feel(t, y_.data());
        std::copy_n(felt_.data(), d, n);
    }
    if (!goes_on) std::fill_n(change, d, 0.0);
    exact::kernels().multiply(rows, n_ + 2 * columns, step.flow.data(), n_ + 2 * columns, y_.data(), 1, out_.data());
    feel(t + step.length, out_.data());
    for (std::size_t k = 0; k < d; ++k) bend_[k] = felt_[k] - n[k] - change[k];
    const double* const phi2 = step.flow.data() + out_.size() * (static_cast<std::size_t>(n_) + d);
    exact::kernels().multiply(rows, columns, goes_on ? step.bent.data() : phi2, columns, bend_.data(), 1,
                              trial_.data());
    for (std::size_t k = 0; k < out_.size(); ++k) out_[k] += trial_[k];
    guards_near(out_.data(), g1_.data());
    if (any_negative(g1_.data(), guard_count())) {
        rest_of_ = along_ = nullptr;
        return through_switches(t, step.length);
    }
    for (std::size_t k = 0; k < d; ++k) {
        change[k] = felt_[k] - n[k];
        n[k] = felt_[k];
    }
    rest_of_ = now_;
    along_ = whole ? now_ : nullptr;
    std::copy_n(out_.data(), n_, y_.data());
    at_end_ = true;
    return std::isfinite(y_[0]);
}

}  // namespace dualdrive::innovations
