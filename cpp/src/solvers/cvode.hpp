// CVODES behind the face of a solver: the only place that knows SUNDIALS.
//
// What CVODE's root-finding does not do (two crossings in one step, a start on the surface) is for the caller: see
// simulation/crossing.cpp.
#pragma once

#include "dualdrive/solver.hpp"

namespace dualdrive {

class Cvode final : public Solver {
  public:
    // root_direction: -1 only falling, 0 both, per guard. parameter_scale: typical size per sensitivity.
    Cvode(Problem& problem, Size size, Method method, double rtol, std::span<const int> root_direction,
          std::span<const double> parameter_scale);
    ~Cvode() override;

    void restart(double t, std::span<const double> atol, double quadrature_atol) override;
    void limit_step(double longest, double turning) override;
    Outcome step(double stop) override;
    double time() const override;
    double previous_time() const override;
    std::span<double> state() override;
    std::span<double> sensitivity(int k) override;
    std::span<double> quadrature() override;
    void go_back(double t) override;
    void state_at(double t, double* z) const override;
    void sensitivity_at(double t, int k, double* s) const override;
    void quadrature_at(double t, double* q) const override;
    std::span<const int> roots() const override;
    Failure failure() const override;
    Counts counts() const override;
    std::string name() const override;

  private:
    struct Hidden;
    std::unique_ptr<Hidden> h_;
};

}  // namespace dualdrive
