#include "handover.hpp"

#include <algorithm>

namespace dualdrive {

namespace {

constexpr double clearly = 2.0;  // times slower: tried again more seldom
constexpr double worth = 4.0;    // trials that what is left of the run must cost

}  // namespace

Handover::Handover(std::vector<Candidate> candidates, int sensitivities, double end)
    : sensitivities_(sensitivities), end_(end) {
    for (Candidate& c : candidates) members_.push_back({std::move(c), nullptr, c.first});
    members_.front().solver = members_.front().candidate.make();
}

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
    Outcome outcome = now().step(stop);
    while (outcome == Outcome::failed && give_to_another()) outcome = now().step(stop);
    return outcome;
}

// Where the run would end with the solver in charge, but not with another. Who fails is not tried again.
bool Handover::give_to_another() {
    const std::size_t failed = charge_;
    if (on_trial_) {
        hand_over(former_);
    } else {
        if (members_[charge_].candidate.lone) return false;
        hand_over(charge_ + 1);
    }
    members_[failed].out = true;
    on_trial_ = false;
    settle_in();
    return true;
}

void Handover::hand_over(std::size_t to) {
    Solver& from = now();
    Member& next = members_[to];
    if (!next.solver) {
        next.solver = next.candidate.make();
        next.solver->limit_step(longest_, turning_);
    }
    charge_ = to;
    std::ranges::copy(from.state(), now().state().begin());
    std::ranges::copy(from.quadrature(), now().quadrature().begin());
    for (int k = 0; k < sensitivities_; ++k) std::ranges::copy(from.sensitivity(k), now().sensitivity(k).begin());
    start(from.time());
}

void Handover::start(double t) {
    const double share = members_[charge_].candidate.share;
    std::vector<double> atol(atol_);
    for (double& a : atol) a *= share;
    now().restart(t, atol, share * quadrature_atol_);
}

// What a solver has cost in all.
double Handover::work_of(const Member& m) const {
    if (!m.solver) return 0.0;
    const Counts c = m.solver->counts();
    const auto& [rate, step, jacobian, look] = m.candidate.price;
    return rate * static_cast<double>(c.rhs) + step * static_cast<double>(c.steps) +
           jacobian * static_cast<double>(c.jacobians) + look * static_cast<double>(c.guards);
}

double Handover::all_work() const {
    double sum = 0.0;
    for (const Member& m : members_) sum += work_of(m);
    return sum;
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
    if (!halfway_ && done >= 0.5 * trial) {
        halfway_ = true;
        half_ = here();
    }
    if (done < trial) return;
    on_trial_ = false;
    Member &tried = members_[charge_], &before = members_[former_];
    tried.pace = pace_since(half_);
    const bool stays = tried.pace > before.pace, far = clearly * tried.pace < before.pace;
    Member& waits = stays ? before : tried;
    waits.spacing = far ? std::clamp(2.0 * tried.spacing, late, latest) : late;
    if (!stays) hand_over(former_);
    waits.waits_since = all_work();
    settle_in();
}

// Another solver is tried now and then, and where the one in charge has become slower than the other was when last seen,
// or takes steps for stability alone: then the last one, which is for that.
void Handover::look_for_a_trial() {
    const double done = work() - begin_.work;
    if (work() - window_[1].work >= soon) window_ = {window_[1], here()};
    const double pace = pace_since(window_[0]);
    const bool known = done >= soon;
    if (end_ - time() < worth * trial * pace) return;
    std::size_t next = charge_;
    double most = -1.0;
    for (std::size_t k = 0; k < members_.size(); ++k) {
        const Member& m = members_[k];
        if (k == charge_ || m.out || m.candidate.best < pace) continue;
        const bool untried = m.pace == 0.0;
        const bool stiff = k + 1 == members_.size() && now().stiff() && (known || untried);
        const bool due = known && (all_work() - m.waits_since >= m.spacing || pace < m.pace);
        const double expected = stiff || untried ? std::numeric_limits<double>::infinity() : m.pace;
        if ((due || stiff) && expected > most) {
            most = expected;
            next = k;
        }
    }
    if (next == charge_) return;
    members_[charge_].pace = pace;
    former_ = charge_;
    hand_over(next);
    on_trial_ = true;
    halfway_ = false;
    begin_ = here();
}

Solver::Counts Handover::counts() const {
    Counts all{};
    for (const Member& m : members_) {
        if (!m.solver) continue;
        const Counts c = m.solver->counts();
        all = {all.steps + c.steps, all.rhs + c.rhs, all.jacobians + c.jacobians, all.guards + c.guards,
               all.error_test_failures + c.error_test_failures};
    }
    return all;
}

std::string Handover::name() const {
    std::string names;
    for (const Member& m : members_)
        if (m.solver) names += (names.empty() ? "" : ", ") + m.solver->name();
    return names;
}

}  // namespace dualdrive
