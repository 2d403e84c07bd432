// Forward sensitivities over the engine's steps. s = ∂y/∂p obeys
//     ṡ = A s + A_p y + m,   m = (∂f/∂y − A) s + (∂f/∂p − A_p y)
// with A the tangent and A_p = ∂A/∂p. What is linear is propagated, the derivative of the propagators included; m is a
// polynomial through its values at the nodes, as the rest of the rates is (docs/theory/exponential.md). Inputs depend on no
// parameter, so that their knots break y alone.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "../exact/generator.hpp"
#include "dualdrive/solver.hpp"
#include "slope_propagators.hpp"

namespace dualdrive::exponential {

class Sensitivities {
  public:
    struct Setup {
        Problem& problem;
        const exact::Generator& generator;
        double grid, rtol;
        int states;
        std::vector<double> scale;  // typical size of each parameter
    };
    // A step over all nodes: (y, c) at each, and 2^level of the grid from one to the next.
    struct Step {
        Propagators* propagators;
        SlopePropagators* slopes;
        Cell cell;
        int level;
        double origin;
        const double* columns;
    };
    struct Found {
        double error = 0.0;  // of what is allowed; infinite where sweeps do not settle or the laws give no number
        std::vector<int> undriven;  // rows that m acts on and the rest does not
        bool finite = true;
    };
    explicit Sensitivities(Setup setup);
    Sensitivities(const Sensitivities&) = delete;
    Sensitivities& operator=(const Sensitivities&) = delete;

    // As they were last set, or brought; may be written to.
    std::span<double> now(int k) { return {now_.data() + static_cast<std::size_t>(k) * states_, states_}; }
    // Over a step that begins with now().
    Found over(const Step& step, std::span<const double> atol);
    // now() becomes that at a time within the last step.
    void bring(double t);
    // (s, c) of every parameter at a time within it, apart() from each other.
    const double* at(double t);
    std::size_t apart() const { return width_; }

  private:
    using Vector = std::vector<double>;
    struct Moment {
        double t = 0.0;
        Vector yc, columns;  // c as derivatives there, in units of the step's level
    };
    void open(const Step& step, std::span<const double> atol);
    bool linearise(std::size_t node, Found& found);
    void find_undriven(const double* y, Found& found) const;
    void give();
    void drive();
    double sweep();
    double interpolation_error();
    double farthest(const double* columns, std::size_t apart) const;
    void weigh();
    void begin_at(std::size_t node, Moment& at) const;
    void march(Moment& at, double to);
    void march_freely(Moment& at, double length);
    void apply(Moment& at, int level);

    double node_time(std::size_t node) const { return step_->origin + static_cast<double>(node) * delta_; }
    double* column(std::size_t node) { return columns_.data() + node * parameters_ * width_; }
    const double* column(std::size_t node) const { return columns_.data() + node * parameters_ * width_; }

    const Setup setup_;
    const std::size_t parameters_, states_;
    std::optional<Step> step_;  // at hand
    std::size_t width_ = 0, rows_ = 0, m_ = 0, lanes_ = 0;
    double delta_ = 0.0;
    std::vector<double> atol_;
    Vector now_;             // [parameter][state]
    Vector columns_;         // [node][parameter]: (s, c)
    Vector given_;           // [node][parameter][row]: what (y, c) add over the interval from there
    Vector bends_, own_;     // ∂m/∂s, [node][driven][state]; m without s, [node][parameter][driven]
    Vector values_, terms_;  // m, [node][lane]; its derivatives, [node][order][lane]
    Vector weight_, jacobian_, rates_, linear_, next_, moved_, scaled_, scaled_yc_;
    const Vector still_;
    std::vector<const double*> no_slopes_;
    std::vector<double*> rate_of_;
    Moment at_;
};

}  // namespace dualdrive::exponential
