// An explicit Runge-Kutta method of order 8 behind the face of a solver: few, long steps, no memory of steps before, so
// that a switch costs little. For machines that ring; a stiff one drives it into small steps and is better left to
// CVODE's bdf.
//
// States, sensitivities and quadratures are one vector: all are under error control, all have the same dense output.
// Guards are not looked at here, see simulation/crossing.cpp.
#pragma once

#include <limits>

#include "dualdrive/solver.hpp"

namespace dualdrive {

class RungeKutta final : public Solver {
  public:
    // parameter_scale: typical size per sensitivity. stiff_beyond: how fast a pole, in 1/s, must be to count as stiff where
    // it alone limits the step.
    RungeKutta(Problem& problem, Size size, double rtol, std::span<const double> parameter_scale, double stiff_beyond);

    void restart(double t, std::span<const double> atol, double quadrature_atol) override;
    void limit_step(double longest, double turning) override;
    Outcome step(double stop) override;
    double time() const override { return t_; }
    double previous_time() const override { return begin_; }
    std::span<double> state() override { return part(0, states_); }
    std::span<double> sensitivity(int k) override;
    std::span<double> quadrature() override { return part(quadratures_from_, width_ - quadratures_from_); }
    void go_back(double t) override;
    void state_at(double t, double* z) const override { at(t, 0, states_, z); }
    void sensitivity_at(double t, int k, double* s) const override;
    void quadrature_at(double t, double* q) const override;
    std::span<const int> roots() const override { return {}; }
    Failure failure() const override;
    Counts counts() const override { return counts_; }
    std::string name() const override { return "dop853"; }
    int sensitivities() const { return static_cast<int>(parameter_scale_.size()); }
    int looks() const override { return 3; }

    // Whether for some steps in a row a pole beyond `stiff_beyond` has limited the step, by stability and not by accuracy.
    bool stiff() const override { return limited_ >= stiff_after; }

  private:
    static constexpr int stiff_after = 15, mild_after = 6;  // steps
    using Vector = std::vector<double>;
    std::span<double> part(std::size_t from, std::size_t n) { return {now_.data() + from, n}; }
    const double* rate(std::size_t stage) const { return rates_.data() + stage * width_; }
    double* rate(std::size_t stage) { return rates_.data() + stage * width_; }
    double* F(std::size_t k) { return extension_.data() + k * width_; }
    const double* F(std::size_t k) const { return extension_.data() + k * width_; }

    bool rates(double t, const double* y, double* rate);
    template <const auto& row>
    void combine(double h, Vector& y) const;
    template <const auto& row>
    bool stage(double c, std::size_t k, double h);
    void weigh();
    double try_step(double end);
    double try_short_step(double end);
    double forgiven(double e, double h) const;
    double error(double h) const;
    double defect(double h);
    template <class Component>
    double size(Component&& component) const;
    double first_step();
    bool extend(double h);
    void join(double h);
    double fastest_pole(std::size_t before) const;
    void inside(double t, std::size_t first, std::size_t n, double* out) const;
    void at(double t, std::size_t first, std::size_t n, double* out) const;

    Problem& problem_;
    const std::size_t states_, quadratures_from_, width_;
    const double rtol_, stiff_beyond_;
    const Vector parameter_scale_;
    std::vector<std::size_t> ends_;  // of the parts whose errors count separately: state, each sensitivity, work

    double t_ = 0.0, begin_ = 0.0, end_ = 0.0;  // now; the last step, even where part of it was taken back
    double next_ = 0.0, least_ = 0.0, longest_ = std::numeric_limits<double>::infinity(), pole_ = 0.0;
    int since_short_ = 0, short_pause_ = 0;  // steps since one of order 5 was tried, and before the next
    int limited_ = 0, mild_ = 0;             // steps in a row at the limit of stability, and not
    bool rate_known_ = false, finite_ = true;
    Vector now_, from_, to_, atol_, weight_, stage_, middle_;
    Vector rates_, extension_;  // [stage][component], [coefficient][component]
    std::vector<const double*> slope_in_;
    std::vector<double*> slope_out_;
    Counts counts_{};
};

}  // namespace dualdrive
