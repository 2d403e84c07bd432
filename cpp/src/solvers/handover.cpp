#include "handover.hpp"

#include <algorithm>

namespace dualdrive {

namespace {

// Of a multistep method, in evaluations of the rates: its algebra and the looks at guards, and the Jacobian by columns of
// duals; measured on the machines of benchmarks/laws.py.
constexpr double step_cost = 4.4, jacobian_cost = 14.0;
constexpr double clearly = 2.0;  // times slower: tried again more seldom
constexpr double worth = 4.0;    // trials that what is left of the run must cost

}  // namespace

void Handover::restart(double t, std::span<const double> atol, double quadrature_atol) {
    atol_.assign(atol.begin(), atol.end());
    quadrature_atol_ = quadrature_atol;
    start(t);
    if (work() == 0.0) settle_in();
}

void Handover::limit_step(double longest, double turning) {
    longest_ = longest;
    turning_ = turning;
    now().limit_step(longest, turning);
}

Solver::Outcome Handover::step(double stop) {
    if (on_trial_)
        judge();
    else
        look_for_a_trial();
    const Outcome outcome = now().step(stop);
    if (outcome != Outcome::failed || !on_trial_) return outcome;
    on_trial_ = false;  // the run would not have ended here
    no_more_ = true;
    hand_over();
    return now().step(stop);
}

void Handover::hand_over() {
    Solver& from = now();
    if (!on_stiff_ && !stiff_) {
        stiff_ = make_stiff_();
        stiff_->limit_step(longest_, turning_);
    }
    on_stiff_ = !on_stiff_;
    Solver& to = now();
    std::ranges::copy(from.state(), to.state().begin());
    std::ranges::copy(from.quadrature(), to.quadrature().begin());
    for (int k = 0; k < mild_->sensitivities(); ++k) std::ranges::copy(from.sensitivity(k), to.sensitivity(k).begin());
    start(from.time());
}

void Handover::start(double t) {
    if (!on_stiff_) return mild_->restart(t, atol_, quadrature_atol_);
    std::vector<double> finer(atol_);
    for (double& a : finer) a *= stiff_share;
    stiff_->restart(t, finer, stiff_share * quadrature_atol_);
}

// What the solver in charge has cost in all.
double Handover::work() const {
    const Counts c = now().counts();
    if (!on_stiff_) return static_cast<double>(c.rhs);
    return step_cost * static_cast<double>(c.steps) + jacobian_cost * static_cast<double>(c.jacobians);
}

// Seconds of the run for an evaluation's work.
double Handover::pace_since(const Mark& m) const {
    const auto [t, done] = here();
    return done > m.work ? (t - m.t) / (done - m.work) : 0.0;
}

void Handover::settle_in() {
    begin_ = here();
    window_ = {begin_, begin_};
}

// A trial shows in its second half what a solver is worth that has found its step. The slower one waits.
void Handover::judge() {
    const double done = work() - begin_.work;
    if (!halfway_ && done >= 0.5 * trial_) {
        halfway_ = true;
        half_ = here();
    }
    if (done < trial_) return;
    on_trial_ = false;
    const double pace = pace_since(half_);
    const bool far = clearly * pace < other_pace_;
    spacing_ = far ? std::clamp(2.0 * spacing_, least_, most_) : least_;
    if (pace <= other_pace_) {
        other_pace_ = pace;
        hand_over();
    }
    settle_in();
}

// The other solver is tried now and then, and where the one in charge has become slower than the other was when last seen,
// or takes steps for stability alone.
void Handover::look_for_a_trial() {
    const double done = work() - begin_.work;
    if (work() - window_[1].work >= first_) window_ = {window_[1], here()};
    const double pace = pace_since(window_[0]);
    const bool known = done >= first_, stiff = !on_stiff_ && mild_->stiff() && (known || !stiff_);
    const bool due = known && (done >= spacing_ || pace < other_pace_);
    if (no_more_ || !(due || stiff) || end_ - time() < worth * trial_ * pace) return;
    other_pace_ = pace;
    hand_over();
    on_trial_ = true;
    halfway_ = false;
    begin_ = here();
}

Solver::Counts Handover::counts() const {
    const Counts a = mild_->counts(), b = stiff_ ? stiff_->counts() : Counts{};
    return {a.steps + b.steps, a.rhs + b.rhs, a.jacobians + b.jacobians, a.guards + b.guards,
            a.error_test_failures + b.error_test_failures};
}

}  // namespace dualdrive
