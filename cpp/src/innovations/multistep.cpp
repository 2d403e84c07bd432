// Laws that are not affine, between samples: ẏ = A y + B n(t, y), A the tangent in the present modes and B a column of one for
// each rate on which they act.
//
// Exponential Adams method of order 3 in its form PEC (Hochbruck, Ostermann, Acta Numerica 19 (2010) 209–286, §2.5): n is
// predicted by a straight line through its values at the beginning and a step before, evaluated once where that leads, and the
// parabola through all three serves the step. The first step in a tangent has no step before: there it is predicted as
// constant, and a straight line serves. A step that the parabola bends by more than a little is taken in halves, and the next
// ones are as short while they need be. Where a correction moves the state n goes along by the laws' own slopes.
#include <algorithm>
#include <cmath>
#include <limits>

#include "../solvers/exact/kernels.hpp"
#include "dense.hpp"
#include "dualdrive/effects.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr int serves = 128;            // corrections, for which slopes of laws are kept that one evaluation tells
constexpr double shortest = 1.0 / 16;  // of a substep: steps that bend too much are halved down to it
constexpr double easy = 1.0 / 16;      // of what a step may bend: one twice as long bends eight times as much

}  // namespace

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

std::vector<double> Flow::felt(const exact::Laws<double>& laws, const Modes& modes) const {
    Eigen::MatrixXd A = widened(laws.A, n_), guards = widened(laws.guards, laws.guards.rows());
    push(A, guards, modes);
    Eigen::MatrixXd rows(static_cast<Eigen::Index>(driven_.size() + watching_.size()), n_);
    Eigen::Index row = 0;
    for (const int k : driven_) rows.row(row++) = A.row(k);
    for (const int k : watching_) rows.row(row++) = guards.row(k);
    return packed_rows(rows);
}

// n, and what laws add to the tangent's guards, at (t, y).
void Flow::feel(double t, const double* y) {
    evaluate(t, y, scope_);
    exact::kernels().multiply(static_cast<int>(felt_.size()), n_, now_->felt.data(), n_, y, 1, felt_.data());
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

// Speeds, what angles follow from, and currents and own states of laws; or what the whole machine has.
std::vector<int> Flow::felt_states() const {
    std::vector<int> found;
    const auto add = [&](int state) {
        if (state >= 0) found.push_back(state);
    };
    if (affine_) return found;
    if (scope_ == Scope::whole) {
        for (int k = 0; k < states(); ++k) add(k);
        return found;
    }
    for (int g = 0; g < layout_.groups; ++g) add(g);
    for (const int twist : layout_.twist) add(twist);
    for (const int angle : layout_.root_angle) add(angle);
    for (const int k : driven_)
        if (k >= layout_.groups) add(k);
    return found;
}

// What is felt where a correction has moved the state: by the laws' own slopes, which are taken now and then.
void Flow::feel_correction(double t, const double* before) {
    const std::size_t rows = felt_.size(), d = driven_.size();
    if (slopes_of_ != now_ || --slopes_serve_ <= 0) {
        const Eigen::MatrixXd own = reader_.slopes(modes_, t, cell_, y_.data(), feeling_, scope_);
        slopes_.assign(rows * feeling_.size(), 0.0);
        for (std::size_t c = 0; c < feeling_.size(); ++c) {
            const double* const tangent = now_->felt.data() + rows * static_cast<std::size_t>(feeling_[c]);
            double* const column = slopes_.data() + rows * c;
            const auto of = static_cast<Eigen::Index>(c);
            for (std::size_t k = 0; k < d; ++k) column[k] = own(driven_[k], of) - tangent[k];
            for (std::size_t k = 0; k < watching_.size(); ++k)
                column[d + k] = own(states() + watching_[k], of) - tangent[d + k];
        }
        slopes_of_ = now_;
        slopes_serve_ = serves * (1 + static_cast<int>(feeling_.size()) / directions);
    }
    for (std::size_t c = 0; c < feeling_.size(); ++c) {
        const auto k = static_cast<std::size_t>(feeling_[c]);
        shift_[c] = y_[k] - before[k];
    }
    const auto columns = static_cast<int>(feeling_.size());
    exact::kernels().multiply(static_cast<int>(rows), columns, slopes_.data(), columns, shift_.data(), 1,
                              trial_.data());
    for (std::size_t k = 0; k < d + watching_.size(); ++k) felt_[k] += trial_[k];
    std::copy_n(felt_.data(), d, y_.data() + n_);
}

// Guards at a state near the one where laws were felt last, if there are any.
void Flow::guards_near(double t, const double* y, double* g) {
    const int rows = exact::padded(static_cast<int>(guard_count()));
    exact::kernels().multiply(rows, n_, now_->watched.data(), n_, y, 1, g);
    const double* rest = felt_.data() + driven_.size();
    for (const int k : watching_) g[k] += *rest++;
    if (!affine_ && !now_->slaved.empty()) write_riding_guards(t, y, g);
}

// What the parabola of a step adds to the straight line, of what it may: the step leaves out less than that.
double Flow::bending() const {
    double most = 0.0;
    for (int j = 0; j < outputs_; ++j) {
        const auto k = static_cast<std::size_t>(j);
        most = std::max(most, std::abs(trial_[static_cast<std::size_t>(n_) + k]) / shows_[k].tolerance);
    }
    return most;
}

// n at the beginning of a step, and its change over one as long as that by the straight line; where there is none yet, none.
void Flow::begin_step(double t, double length) {
    const std::size_t d = driven_.size();
    double *const n = y_.data() + n_, *const change = n + d;
    if (rest_of_ != now_) {
        feel(t, y_.data());
        std::copy_n(felt_.data(), d, n);
    }
    const double longer = along_ == now_ ? length / along_length_ : 0.0;
    for (std::size_t k = 0; k < d; ++k) change[k] *= longer;
    rest_of_ = now_;
    before_ = along_ == now_ ? along_length_ / length : infinite;
    along_length_ = length;
}

// What the parabola through n a step before, at the beginning and at the end adds to the straight line that was flown along:
// n(τ) = n₀ + a τ + b τ²/2 over the step, −ρ ≤ τ ≤ 1.
void Flow::bend(const Step& step) {
    const std::size_t d = driven_.size();
    const double *const n = y_.data() + n_, *const change = n + d;
    const double curved = 2.0 / (1.0 + before_), tilted = 1.0 - 0.5 * curved;  // ρ/(1 + ρ)
    for (std::size_t k = 0; k < d; ++k) {
        const double missed = felt_[k] - n[k] - change[k];
        bend_[k] = tilted * missed;
        bend_[d + k] = curved * missed;
    }
    const auto columns = static_cast<int>(2 * d);
    const auto rows = static_cast<int>(step.flow.size() / (static_cast<std::size_t>(n_) + 3 * d));
    const double* const phi2 = step.flow.data() + static_cast<std::size_t>(rows) * (static_cast<std::size_t>(n_) + d);
    exact::kernels().multiply(rows, columns, phi2, columns, bend_.data(), 1, trial_.data());
}

// A step of laws. checks: of the rows below its outputs; of a guard that feels laws, these change along a straight line.
Flow::Flown Flow::fly(double t, const Step& step, const std::vector<Lifted::Check>& checks) {
    const std::size_t d = driven_.size();
    const auto rows = static_cast<int>(step.flow.size() / (static_cast<std::size_t>(n_) + 3 * d)),
               columns = n_ + static_cast<int>(2 * d);
    begin_step(t, step.length);
    std::copy(felt_.begin() + static_cast<std::ptrdiff_t>(d), felt_.end(), rest_.begin());
    exact::kernels().multiply(rows, columns, step.flow.data(), columns, y_.data(), 1, out_.data());
    feel(t + step.length, out_.data());
    bend(step);
    const double bends = bending();
    if (bends > 1.0 && step.length > shortest * h_) {
        finer_ = std::max(finer_, 1 + std::ilogb(h_ / step.length));
        return Flown::bent;
    }
    most_bent_ = std::max(most_bent_, bends);
    for (std::size_t k = 0; k < static_cast<std::size_t>(rows); ++k) out_[k] += trial_[k];
    guards_near(t + step.length, out_.data(), g1_.data());
    bool fallen = any_negative(g1_.data(), guard_count());
    const double* left = out_.data() + n_ + outputs_;
    for (const Lifted::Check& check : checks) {
        double g = *left++;
        if (const auto k = static_cast<std::size_t>(check.felt); check.felt >= 0)
            g += (1.0 - check.when) * rest_[k] + check.when * felt_[d + k];
        fallen |= g < 0.0;
    }
    if (fallen) return Flown::fallen;
    double *const n = y_.data() + n_, *const change = n + d;
    for (std::size_t k = 0; k < d; ++k) change[k] = felt_[k] - n[k];
    std::copy_n(felt_.data(), d, n);
    along_ = now_;
    std::copy_n(out_.data(), n_, y_.data());
    at_end_ = true;
    return Flown::done;
}

// The next sample in steps twice as long, where those of this one had been too short.
void Flow::lengthen() {
    if (finer_ > 0 && most_bent_ < easy) --finer_;
    most_bent_ = 0.0;
}

bool Flow::halves(double t, double length) {
    const double half = 0.5 * length;
    return advance(t, half) && advance(t + half, half);
}

bool Flow::integrate(double t, const Step& step) {
    const double length = step.length;
    switch (fly(t, step, {})) {
        case Flown::bent:
            return halves(t, length);
        case Flown::fallen:
            rest_of_ = along_ = nullptr;
            return through_switches(t, length, true);
        case Flown::done:
            break;
    }
    if (memory_) memory_->arrive(t + length, model_);
    return std::isfinite(y_[0]);
}

}  // namespace dualdrive::innovations
