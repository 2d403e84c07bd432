// An explicit solver for as long as the machine is mild, and another from where it turns out stiff to the end of the run:
// friction with memory, say, is mild at rest and stiff while it slides fast.
#pragma once

#include <functional>
#include <memory>

#include "explicit/runge_kutta.hpp"

namespace dualdrive {

class Handover final : public Solver {
  public:
    using Make = std::function<std::unique_ptr<Solver>()>;
    Handover(std::unique_ptr<RungeKutta> mild, Make stiff) : mild_(std::move(mild)), make_stiff_(std::move(stiff)) {}

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
    Solver& now() const { return stiff_ ? *stiff_ : *mild_; }
    void hand_over();

    std::unique_ptr<RungeKutta> mild_;
    std::unique_ptr<Solver> stiff_;
    Make make_stiff_;
    std::vector<double> atol_;
    double quadrature_atol_ = 0.0, longest_ = 0.0, turning_ = 0.0;
};

}  // namespace dualdrive
