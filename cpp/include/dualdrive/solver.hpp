// What a run needs of an integrator. The engines behind it stand in cpp/src/solvers, one folder or file each:
// CVODE's multistep methods (the only place that knows SUNDIALS), explicit Runge-Kutta, exponential collocation, exact
// propagation.
//
// One step at a time, up to a stop time, with guards watched on every step, sensitivities and quadratures. The modes are
// frozen within a step; whoever changes them restarts the solver.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace dualdrive {

// automatic: exact where every active effect is affine in its modes, else what docs/theory/engines.md says.
enum class Engine { automatic, exact, exponential, explicit_rk, cvode };
// Of the cvode engine. automatic: adams for a plant that rings, bdf for a stiff one.
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

    Solver() = default;
    virtual ~Solver() = default;
    Solver(const Solver&) = delete;
    Solver& operator=(const Solver&) = delete;

    // Start afresh at (t, state()), with sensitivity(k) and quadrature() as they stand, absolute tolerances per state.
    virtual void restart(double t, std::span<const double> atol, double quadrature_atol) = 0;
    // No step longer than `longest`, and none that could stride over an input unseen, which takes `turning` to come and go.
    // Infinite: no limit.
    virtual void limit_step(double longest, double turning) = 0;

    // One internal step, at most to `stop`. After root or stopped, time() and state() are at that point.
    virtual Outcome step(double stop) = 0;

    virtual double time() const = 0;
    virtual double previous_time() const = 0;  // begin of the last step
    virtual std::span<double> state() = 0;
    virtual std::span<double> sensitivity(int k) = 0;
    virtual std::span<double> quadrature() = 0;

    // Take back the last step from `t` on: time, state, sensitivities and quadratures are then those at t. Needs a
    // restart before the next step.
    virtual void go_back(double t) = 0;

    // State, sensitivity and quadrature inside the last step.
    virtual void state_at(double t, double* z) const = 0;
    virtual void sensitivity_at(double t, int k, double* s) const = 0;
    virtual void quadrature_at(double t, double* q) const = 0;
    // The stored energy that quadratures belong to, where the solver has it cheaper than the model does.
    virtual std::optional<double> stored_energy_at(double /*t*/) const { return std::nullopt; }

    // The recorded signals at times within the last step, times × signals, where the solver has them cheaper than the
    // model does.
    virtual bool signals_at(std::span<const double> /*times*/, double* /*signals*/) const { return false; }
    // Their sensitivities at one time, signals × parameters row-major.
    virtual bool signal_slopes_at(double /*t*/, double* /*slopes*/) const { return false; }

    // At the present state, in the modes as they are now, where the solver has them cheaper than the model: guards, rates,
    // and how fast one guard changes.
    virtual bool guards_now(double* /*g*/) { return false; }
    virtual bool rates_now(double* /*rate*/) { return false; }
    virtual std::optional<double> guard_rate_now(int /*guard*/) { return std::nullopt; }
    virtual bool guard_slopes_now(int /*guard*/, double* /*slopes*/) { return false; }  // per sensitivity
    virtual std::span<const int> roots() const = 0;  // after Outcome::root: -1 falling, 1 rising, 0 not at a root
    // Whether a step that crosses a guard always ends there: no second look is needed.
    virtual bool finds_every_root() const { return false; }
    // Else: at how many points inside a step guards must be looked at, so that a parabola follows them from each odd one
    // to its neighbours. An odd number.
    virtual int looks() const { return 1; }
    // Whether the solver saw all guards stay so far off zero in the last step that none needs a look.
    virtual bool keeps_off_guards() const { return false; }

    // Whether it takes steps for stability, or to contract, and not for accuracy: another may be the cheaper.
    virtual bool stiff() const { return false; }

    struct Failure {
        bool step_vanished;
        std::string advice;
    };
    virtual Failure failure() const = 0;  // after Outcome::failed
    static constexpr const char* not_finite =
        "the equations gave a value that is not finite; check parameters and initial state";

    struct Counts {
        long steps, rhs, jacobians, guards, error_test_failures;
    };
    virtual Counts counts() const = 0;
    virtual std::string name() const = 0;  // as statistics report it: adams, bdf, exact, ...
};

}  // namespace dualdrive
