// Two solvers in turn, an explicit one and one for what is stiff, and the run goes on with the cheaper of them: friction
// with memory, say, is mild at rest and stiff while it slides fast, and a machine that hardly moves costs an explicit
// method its steps for stability all the same.
//
// Nothing is computed twice: a trial of the other solver is a stretch of the run. Costs are counted, not timed, so that the
// same run takes the same turns and gives the same bits.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <memory>

#include "explicit/runge_kutta.hpp"

namespace dualdrive {

class Handover final : public Solver {
  public:
    using Make = std::function<std::unique_ptr<Solver>()>;
    // A multistep method errs by a multiple of what the explicit one errs by at the same tolerance (benchmarks/laws.py); it
    // is given this share of it, lest the accuracy of a run hang on who happened to take it.
    static constexpr double stiff_share = 0.1;

    // stiff: makes the other solver, with its share of the relative tolerance; of absolute ones it is given here.
    // end: of the run, s; close to it a trial would not pay.
    Handover(std::unique_ptr<RungeKutta> mild, Make stiff, double end)
        : mild_(std::move(mild)), make_stiff_(std::move(stiff)), end_(end) {}

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
    std::span<const int> roots() const override { return now().roots(); }
    int looks() const override { return now().looks(); }
    Failure failure() const override { return now().failure(); }
    Counts counts() const override;
    std::string name() const override { return stiff_ ? mild_->name() + ", " + stiff_->name() : mild_->name(); }

  private:
    struct Mark {
        double t, work;
    };
    Solver& now() const { return on_stiff_ ? *stiff_ : *mild_; }
    void hand_over();
    void start(double t);  // afresh, the one in charge
    double work() const;
    Mark here() const { return {now().time(), work()}; }
    double pace_since(const Mark& m) const;
    void judge();
    void look_for_a_trial();
    void settle_in();

    std::unique_ptr<RungeKutta> mild_;
    std::unique_ptr<Solver> stiff_;
    Make make_stiff_;
    const double end_;
    std::vector<double> atol_;
    double quadrature_atol_ = 0.0, longest_ = std::numeric_limits<double>::infinity(), turning_ = longest_;

    bool on_stiff_ = false, on_trial_ = false, halfway_ = false, no_more_ = false;
    Mark begin_{0.0, 0.0};                        // of the trial, or of what the solver in charge has done since
    std::array<Mark, 2> window_{};                // begins of the stretch over which pace is told, older first
    Mark half_{0.0, 0.0};                         // of the trial: what comes before is the solver's start
    double other_pace_ = 0.0, spacing_ = first_;  // of the solver that is not in charge, when last seen; next trial

    // In evaluations of the rates.
    static constexpr double trial_ = 800.0, first_ = 2.0 * trial_, least_ = 8.0 * trial_, most_ = 32.0 * trial_;
};

}  // namespace dualdrive
