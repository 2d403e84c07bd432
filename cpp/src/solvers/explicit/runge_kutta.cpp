#include "runge_kutta.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dop853.hpp"
#include "dopri5.hpp"

namespace dualdrive {

namespace {

using dop853::weighted;

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double shortest = 16.0 * std::numeric_limits<double>::epsilon();  // step, of the time
constexpr double safety = 0.8, most_growth = 6.0, most_shrinking = 1.0 / 3.0;
constexpr double after_a_bad_number = 0.25;  // of a step that left the domain of the laws
// Where a rate jumps (the slope of a law with a kink), even the shortest step may miss the tolerance. It is taken as it is
// if it errs by less than this share of the state; where something goes to infinity, it errs by more.
constexpr double most_forgiven = 1e-6;
constexpr double near_instability = 3.0;  // of h times the fastest pole; the method is stable up to about 6
constexpr int longest_pause = 31;         // steps without another try of a short one, after many that failed
constexpr double inner_share = 0.2;       // of the defect in mid-step that counts as error; chosen by measurement

// How a step should change that erred by e times what is allowed; both its errors go with the eighth power.
double change(double e) { return e > 0 ? safety * std::pow(e, -1.0 / dop853::order) : most_growth; }

}  // namespace

RungeKutta::RungeKutta(Problem& problem, Size size, double rtol, std::span<const double> parameter_scale,
                       double stiff_beyond)
    : problem_(problem),
      states_(static_cast<std::size_t>(size.states)),
      quadratures_from_(states_ * static_cast<std::size_t>(1 + size.sensitivities)),
      width_(quadratures_from_ + static_cast<std::size_t>(size.quadratures)),
      rtol_(rtol),
      stiff_beyond_(stiff_beyond),
      parameter_scale_(parameter_scale.begin(), parameter_scale.end()),
      slope_in_(parameter_scale.size()),
      slope_out_(parameter_scale.size()) {
    for (Vector* v : {&now_, &from_, &to_, &atol_, &weight_, &stage_, &middle_}) v->assign(width_, 0.0);
    rates_.assign(dop853::stages * width_, 0.0);
    extension_.assign(dop853::powers * width_, 0.0);
    for (std::size_t end = states_; end <= quadratures_from_; end += states_) ends_.push_back(end);
    if (width_ > quadratures_from_) ends_.push_back(width_);
}

void RungeKutta::restart(double t, std::span<const double> atol, double quadrature_atol) {
    t_ = begin_ = end_ = t;
    rate_known_ = false;
    std::copy(atol.begin(), atol.end(), atol_.begin());
    for (std::size_t k = 0; k < parameter_scale_.size(); ++k)
        for (std::size_t i = 0; i < states_; ++i) atol_[(k + 1) * states_ + i] = atol[i] / parameter_scale_[k];
    std::fill(atol_.begin() + static_cast<std::ptrdiff_t>(quadratures_from_), atol_.end(), quadrature_atol);
}

// A multistep method looks at the end of a step only; the stages and the middle lie a sixth of a step apart at most.
void RungeKutta::limit_step(double longest, double turning) { longest_ = std::min(longest, 6.0 * turning); }

std::span<double> RungeKutta::sensitivity(int k) { return part(states_ * static_cast<std::size_t>(1 + k), states_); }

bool RungeKutta::rates(double t, const double* y, double* rate) {
    ++counts_.rhs;
    finite_ = problem_.rhs(t, y, rate);
    if (finite_ && width_ > quadratures_from_) finite_ = problem_.quadrature(t, y, rate + quadratures_from_);
    if (!finite_ || slope_in_.empty()) return finite_;
    for (std::size_t k = 0; k < slope_in_.size(); ++k) {
        slope_in_[k] = y + (k + 1) * states_;
        slope_out_[k] = rate + (k + 1) * states_;
    }
    return finite_ = problem_.sensitivity(t, y, slope_in_.data(), slope_out_.data());
}

// ------------------------------------------------------------------------------------------- one step

Solver::Outcome RungeKutta::step(double stop) {
    begin_ = end_ = t_;
    const double left = stop - t_;
    least_ = shortest * std::max(std::abs(t_), std::abs(stop));
    if (left <= least_) {
        t_ = stop;
        return Outcome::stopped;
    }
    if (rate_known_)
        std::copy_n(rate(dop853::last), width_, rate(0));
    else if (!rates(t_, now_.data(), rate(0)))
        return Outcome::failed;
    from_ = now_;
    if (!(next_ > 0)) next_ = first_step();

    const double wanted = std::max(least_, std::min(next_, longest_));
    // The last two steps before a stop share what is left, so that none is tiny.
    double h = wanted > 0.99 * left ? left : wanted > 0.5 * left ? 0.5 * left : wanted;
    bool rejected = false, stops = h == left;
    double e = infinite;
    if (stops && 2.0 * left <= longest_ && ++since_short_ > short_pause_) {
        e = try_short_step(stop);
        since_short_ = 0;
        short_pause_ = e > 1.0 ? std::min(2 * short_pause_ + 1, longest_pause) : 0;
    }
    if (e > 1.0) e = try_step(stops ? stop : begin_ + h);
    for (; e > 1.0; e = try_step(begin_ + h)) {
        rejected = true;
        stops = false;
        ++counts_.error_test_failures;
        if (h <= least_) {
            end_ = begin_;
            return Outcome::failed;
        }
        h = std::max(least_, h * (e < infinite ? std::clamp(change(e), most_shrinking, safety) : after_a_bad_number));
    }
    ++counts_.steps;
    if (pole_ > stiff_beyond_ && pole_ * h > near_instability)
        ++limited_, mild_ = 0;
    else if (!stiff() && ++mild_ >= mild_after)
        limited_ = 0;
    next_ = h * std::clamp(change(e), most_shrinking, rejected ? 1.0 : most_growth);
    if (h < wanted && !rejected) next_ = std::max(next_, wanted);
    t_ = end_;
    now_ = to_;
    rate_known_ = true;
    return stops ? Outcome::stopped : Outcome::stepped;
}

template <const auto& row>
void RungeKutta::combine(double h, Vector& y) const {
    for (std::size_t i = 0; i < width_; ++i) y[i] = from_[i] + h * weighted<row>(rates_.data(), width_, i);
}

template <const auto& row>
bool RungeKutta::stage(double c, std::size_t k, double h) {
    combine<row>(h, stage_);
    return rates(c < 1.0 ? begin_ + c * h : end_, stage_.data(), rate(k));
}

void RungeKutta::weigh() {
    for (std::size_t i = 0; i < width_; ++i)
        weight_[i] = 1.0 / (atol_[i] + rtol_ * std::max(std::abs(from_[i]), std::abs(to_[i])));
}

// The error of a step over what is allowed, at its end and inside; infinite where the laws give no number.
double RungeKutta::try_step(double end) {
    using namespace dop853;
    end_ = end;
    const double h = end_ - begin_;
    const bool finite = stage<a1>(c[1], 1, h) && stage<a2>(c[2], 2, h) && stage<a3>(c[3], 3, h) &&
                        stage<a4>(c[4], 4, h) && stage<a5>(c[5], 5, h) && stage<a6>(c[6], 6, h) &&
                        stage<a7>(c[7], 7, h) && stage<a8>(c[8], 8, h) && stage<a9>(c[9], 9, h) &&
                        stage<a10>(c[10], 10, h) && stage<a11>(c[11], 11, h);
    if (!finite) return infinite;
    combine<b>(h, to_);
    weigh();
    const double e = forgiven(error(h), h);
    if (e > 1.0) return e;
    if (!rates(end_, to_.data(), rate(last))) return infinite;
    pole_ = fastest_pole(last - 1);
    if (!extend(h)) return infinite;
    return forgiven(std::max(e, inner_share * defect(h)), h);
}

// The same by the method of order 5, at half the work: for steps that are short anyhow, from one sample to the next. Its
// stages and the middle lie three tenths of a step apart at most.
double RungeKutta::try_short_step(double end) {
    using namespace dopri5;
    end_ = end;
    const double h = end_ - begin_;
    const bool finite = stage<a1>(c[1], 1, h) && stage<a2>(c[2], 2, h) && stage<a3>(c[3], 3, h) &&
                        stage<a4>(c[4], 4, h) && stage<a5>(c[5], 5, h);
    if (!finite) return infinite;
    combine<b>(h, to_);
    weigh();
    if (!rates(end_, to_.data(), rate(last))) return infinite;
    const double e = h * size([&](std::size_t i) { return weighted<error_4>(rates_.data(), width_, i); });
    if (e > 1.0) return e;
    pole_ = fastest_pole(stages - 1);
    join(h);
    for (std::size_t i = 0; i < width_; ++i) F(3)[i] = h * weighted<d0>(rates_.data(), width_, i);
    for (std::size_t k = 4; k < dop853::powers; ++k) std::fill_n(F(k), width_, 0.0);
    return std::max(e, inner_share * defect(h));
}

double RungeKutta::forgiven(double e, double h) const {
    return h < 2.0 * least_ && e * rtol_ < most_forgiven ? std::min(e, 1.0) : e;
}

// Both estimates together behave as one of order 8 (Hairer, Nørsett, Wanner, II.10).
double RungeKutta::error(double h) const {
    double worst = 0.0;
    std::size_t i = 0;
    for (const std::size_t end : ends_) {
        const auto n = static_cast<double>(end - i);
        double fifth = 0.0, third = 0.0;
        for (; i < end; ++i) {
            const double e5 = weight_[i] * weighted<dop853::error_5>(rates_.data(), width_, i);
            const double e3 = weight_[i] * weighted<dop853::error_3>(rates_.data(), width_, i);
            fifth += e5 * e5;
            third += e3 * e3;
        }
        if (!std::isfinite(fifth + third)) return infinite;
        if (fifth > 0) worst = std::max(worst, h * fifth / std::sqrt((fifth + 0.01 * third) * n));
    }
    return worst;
}

// The rates at the step's end and at its last stage belong to states that lie close together, apart mostly along the
// fastest motions: their difference quotient shows the fastest pole (Hairer, Wanner, Solving Ordinary Differential
// Equations II, IV.2).
double RungeKutta::fastest_pole(std::size_t before) const {
    double rise = 0.0, run = 0.0;
    for (std::size_t i = 0; i < states_; ++i) {
        const double df = weight_[i] * (rate(dop853::last)[i] - rate(before)[i]);
        const double dy = weight_[i] * (to_[i] - stage_[i]);
        rise += df * df;
        run += dy * dy;
    }
    return run > 0 ? std::sqrt(rise / run) : 0.0;
}

// Root mean square of a vector's weighted components, of the part in which it is largest.
template <class Component>
double RungeKutta::size(Component&& component) const {
    double worst = 0.0;
    std::size_t i = 0;
    for (const std::size_t end : ends_) {
        const auto n = static_cast<double>(end - i);
        double sum = 0.0;
        for (; i < end; ++i) {
            const double v = weight_[i] * component(i);
            sum += v * v;
        }
        if (!std::isfinite(sum)) return infinite;
        worst = std::max(worst, std::sqrt(sum / n));
    }
    return worst;
}

// A hundredth of the time in which the state moves by its own size, refined by a look at the second derivative (Hairer,
// Nørsett, Wanner, II.4).
double RungeKutta::first_step() {
    for (std::size_t i = 0; i < width_; ++i) weight_[i] = 1.0 / (atol_[i] + rtol_ * std::abs(from_[i]));
    const double y = size([&](std::size_t i) { return from_[i]; }), f = size([&](std::size_t i) { return rate(0)[i]; });
    const double h = y < 1e-5 || f < 1e-5 ? 1e-6 : 0.01 * y / f;
    for (std::size_t i = 0; i < width_; ++i) stage_[i] = from_[i] + h * rate(0)[i];
    if (!rates(begin_ + h, stage_.data(), rate(1))) return 1e-3 * h;
    const double steepest = std::max(f, size([&](std::size_t i) { return rate(1)[i] - rate(0)[i]; }) / h);
    return std::min(100.0 * h,
                    steepest > 1e-15 ? std::pow(0.01 / steepest, 1.0 / dop853::order) : std::max(1e-6, 1e-3 * h));
}

// --------------------------------------------------------------------------------------- inside a step

// y(x) = y0 + x (F0 + (1 − x) (F1 + x (F2 + (1 − x) (F3 + …)))), x in 0 … 1
bool RungeKutta::extend(double h) {
    using namespace dop853;
    if (!stage<a13>(c[13], 13, h) || !stage<a14>(c[14], 14, h) || !stage<a15>(c[15], 15, h)) return false;
    join(h);
    for (std::size_t i = 0; i < width_; ++i) {
        F(3)[i] = h * weighted<d0>(rates_.data(), width_, i);
        F(4)[i] = h * weighted<d1>(rates_.data(), width_, i);
        F(5)[i] = h * weighted<d2>(rates_.data(), width_, i);
        F(6)[i] = h * weighted<d3>(rates_.data(), width_, i);
    }
    return true;
}

// What both ends of the step, and the rates there, tell of its inside.
void RungeKutta::join(double h) {
    for (std::size_t i = 0; i < width_; ++i) {
        const double rise = to_[i] - from_[i], at_begin = h * rate(0)[i], at_end = h * rate(dop853::last)[i];
        F(0)[i] = rise;
        F(1)[i] = at_begin - rise;
        F(2)[i] = 2.0 * rise - at_begin - at_end;
    }
}

// How far the extension's slope in mid-step is from the rate there, times h. A fast mode that has died away grows again
// within a step too long for it, and is seen here before it is at the end.
double RungeKutta::defect(double h) {
    const double middle = begin_ + 0.5 * h;
    inside(middle, 0, width_, stage_.data());
    if (!rates(middle, stage_.data(), middle_.data())) return infinite;
    return size(
        [&](std::size_t i) { return F(0)[i] + F(2)[i] / 4.0 + F(4)[i] / 16.0 + F(6)[i] / 64.0 - h * middle_[i]; });
}

void RungeKutta::inside(double t, std::size_t first, std::size_t n, double* out) const {
    const double x = (t - begin_) / (end_ - begin_), y = 1.0 - x;
    for (std::size_t k = 0, i = first; k < n; ++k, ++i) {
        const double high = F(3)[i] + x * (F(4)[i] + y * (F(5)[i] + x * F(6)[i]));
        out[k] = from_[i] + x * (F(0)[i] + y * (F(1)[i] + x * (F(2)[i] + y * high)));
    }
}

void RungeKutta::at(double t, std::size_t first, std::size_t n, double* out) const {
    if (t == t_ || !(end_ > begin_))
        std::copy_n(now_.data() + first, n, out);
    else
        inside(t, first, n, out);
}

void RungeKutta::sensitivity_at(double t, int k, double* s) const {
    at(t, states_ * static_cast<std::size_t>(1 + k), states_, s);
}

void RungeKutta::quadrature_at(double t, double* q) const { at(t, quadratures_from_, width_ - quadratures_from_, q); }

void RungeKutta::go_back(double t) {
    at(t, 0, width_, stage_.data());
    now_ = stage_;
    t_ = t;
    rate_known_ = false;
}

Solver::Failure RungeKutta::failure() const {
    if (!finite_) return {false, not_finite};
    return {
        true,
        "the step size fell to nothing; look for a law or a motion that goes to infinity here, or a stiffness or gain "
        "that is far too large, or try engine = cvode with method = bdf"};
}

}  // namespace dualdrive
