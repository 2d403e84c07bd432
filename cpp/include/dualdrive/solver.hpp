// CVODES behind one small face: the only place that knows SUNDIALS.
//
// One step at a time, up to a stop time, with root-finding on every step, sensitivities and quadratures. What CVODE's
// root-finding does not do (two crossings in one step, a start on the surface) is for the caller: see simulate.cpp.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

namespace dualdrive {

enum class Method { automatic, adams, bdf };

// The problem as the solver sees it. A false return asks the solver for a smaller step.
class Problem {
  public:
    virtual ~Problem() = default;
    virtual bool rhs(double t, const double* z, double* rate) = 0;
    virtual bool guards(double t, const double* z, double* g) = 0;
    virtual bool jacobian(double t, const double* z, double* column_major) = 0;
    virtual bool sensitivity(double t, const double* z, const double* const* s, double* const* rate) = 0;
    virtual bool quadrature(double t, const double* z, double* rate) = 0;
};

class Solver {
  public:
    struct Size {
        int states, guards, sensitivities, quadratures;
    };
    enum class Outcome { stepped, root, stopped, failed };

    // root_direction: -1 only falling, 0 both, per guard. parameter_scale: typical size per sensitivity.
    Solver(Problem& problem, Size size, Method method, double rtol, std::span<const int> root_direction,
           std::span<const double> parameter_scale);
    ~Solver();
    Solver(const Solver&) = delete;
    Solver& operator=(const Solver&) = delete;

    // Start afresh at (t, state()), with sensitivity(k) and quadrature() as they stand, absolute tolerances per state.
    void restart(double t, std::span<const double> atol, double quadrature_atol);
    void limit_step(double longest);

    // One internal step, at most to `stop`. After root or stopped, time() and state() are at that point.
    Outcome step(double stop);

    double time() const;
    double previous_time() const;  // begin of the last step
    std::span<double> state();
    std::span<double> sensitivity(int k);
    std::span<double> quadrature();

    // Take back the last step from `t` on: time, state, sensitivities and quadratures are then those at t. Needs a
    // restart before the next step.
    void go_back(double t);

    // State, sensitivity and quadrature inside the last step.
    void state_at(double t, double* z) const;
    void sensitivity_at(double t, int k, double* s) const;
    void quadrature_at(double t, double* q) const;

    std::span<const int> roots() const;  // after Outcome::root: -1 falling, 1 rising, 0 not at a root
    int flag() const;                    // SUNDIALS' return value of the last step
    static std::string advice(int flag);
    static bool step_vanished(int flag);
    static constexpr const char* not_finite =
        "the equations gave a value that is not finite; check parameters and initial state";

    struct Counts {
        long steps, rhs, jacobians, guards, error_test_failures;
    };
    Counts counts() const;

  private:
    struct Hidden;
    std::unique_ptr<Hidden> h_;
};

}  // namespace dualdrive
