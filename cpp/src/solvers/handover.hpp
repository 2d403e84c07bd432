// Solvers in turn, and the run goes on with the cheapest of them: friction with memory, say, is mild at rest and stiff while
// it slides fast, and a machine that hardly moves costs an explicit method its steps for stability all the same.
//
// Nothing is computed twice: a trial of another solver is a stretch of the run. Costs are counted, not timed, so that the
// same run takes the same turns and gives the same bits.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "dualdrive/solver.hpp"

namespace dualdrive {

class Handover final : public Solver {
  public:
    struct Price {                                // in evaluations of the rates by an explicit method
        double rate, step, jacobian, look = 0.0;  // look: at the state between two steps of its own
    };
    // In evaluations of the rates.
    static constexpr double trial = 800.0, soon = 2.0 * trial, late = 8.0 * trial, latest = 32.0 * trial;
    struct Candidate {
        std::function<std::unique_ptr<Solver>()> make;
        Price price;
        double share = 1.0;   // of the absolute tolerances; of the relative one `make` knows
        bool lone = true;     // whether a run ends that it can't go on with
        double first = soon;  // its first trial comes after so much work
        double best = std::numeric_limits<double>::infinity();  // seconds for an evaluation's work, at most
    };

    // The first of them begins, the last is for what is stiff. end: of the run, s; close to it a trial would not pay.
    Handover(std::vector<Candidate> candidates, int sensitivities, double end);

    void restart(double t, std::span<const double> atol, double quadrature_atol) override;
    void limit_step(double longest, double turning) override;
    Outcome step(double stop) override;
    double time() const override { return now().time(); }
    double previous_time() const override { return now().previous_time(); }
    std::span<double> state() override { return now().state(); }
    std::span<double> sensitivity(int k) override { return now().sensitivity(k); }
    std::span<double> quadrature() override { return now().quadrature(); }
    void go_back(double t) override { now().go_back(t); }
    void state_at(double t, double* z) const override { now().state_at(t, z); }
    void sensitivity_at(double t, int k, double* s) const override { now().sensitivity_at(t, k, s); }
    void quadrature_at(double t, double* q) const override { now().quadrature_at(t, q); }
    bool signal_slopes_at(double t, double* slopes) const override { return now().signal_slopes_at(t, slopes); }
    std::span<const int> roots() const override { return now().roots(); }
    int looks() const override { return now().looks(); }
    bool keeps_off_guards() const override { return now().keeps_off_guards(); }
    Failure failure() const override { return now().failure(); }
    Counts counts() const override;
    std::string name() const override;

  private:
    struct Mark {
        double t, work;
    };
    struct Member {
        Candidate candidate;
        std::unique_ptr<Solver> solver;
        double spacing;            // of its trials, or work before the first
        double pace = 0.0;         // when last seen; 0: never
        double waits_since = 0.0;  // work of all at its last trial's end
        bool out = false;          // failed
    };
    Solver& now() const { return *members_[charge_].solver; }
    void hand_over(std::size_t to);
    bool give_to_another();
    void start(double t);  // afresh, the one in charge
    double work_of(const Member& m) const;
    double work() const { return work_of(members_[charge_]); }
    double all_work() const;
    Mark here() const { return {now().time(), work()}; }
    double pace_since(const Mark& m) const;
    void judge();
    void look_for_a_trial();
    void settle_in();

    std::vector<Member> members_;
    const int sensitivities_;
    const double end_;
    std::vector<double> atol_;
    double quadrature_atol_ = 0.0, longest_ = std::numeric_limits<double>::infinity(), turning_ = longest_;

    std::size_t charge_ = 0, former_ = 0;  // in charge; and before the trial
    bool on_trial_ = false, halfway_ = false;
    Mark begin_{0.0, 0.0};          // of the trial, or of what the solver in charge has done since
    std::array<Mark, 2> window_{};  // begins of the stretch over which pace is told, older first
    Mark half_{0.0, 0.0};           // of the trial: what comes before is the solver's start
};

}  // namespace dualdrive
