#include "exponential.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "../../simulation/instant.hpp"
#include "../exact/kernels.hpp"

namespace dualdrive {

namespace {

using exponential::backward, exponential::last_gram, exponential::most_back, exponential::through_nodes;

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double shortest = 16.0 * std::numeric_limits<double>::epsilon();  // distance of nodes, of the time
constexpr double order = 9.0;  // the error of a step goes with this power of its length
constexpr int first_halvings = 6;      // of the grid: the first step
constexpr int after_switch = 2;        // halvings of the step before, as a switch may leave something fast
constexpr double doubles = 1e-3;       // errors below it allow a step twice as long: 2⁻⁹, and half of that
constexpr double enough = 0.1;         // of what a step may err by: what sweeps may leave
constexpr double least_contraction = 0.05, slow = 0.3;  // a sweep's, as reckoned with; and at which a step is too long
constexpr int most_sweeps = 8;
constexpr double negligible = 1e-4;    // of what a step may err by: a rest that small is none
constexpr double inner_share = 0.2;    // of the defect between nodes that counts as error
constexpr int levels_of_a_bad_number = 2;
constexpr double shape_area = 40.0;    // of |last_gram|'s polynomial between the nodes, about

constexpr std::size_t terms = exponential::nodes;

constexpr std::array<double, terms + 1> inverse_factorial = [] {
    std::array<double, terms + 1> f{1.0};
    for (std::size_t k = 1; k < f.size(); ++k) f[k] = f[k - 1] / static_cast<double>(k);
    return f;
}();

// Over the interval from node j on, of the polynomial through the nodes.
constexpr auto integrals = [] {
    std::array<std::array<double, terms>, terms> w{};
    for (std::size_t j = 0; j < terms; ++j)
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t i = 0; i < terms; ++i) w[j][i] += through_nodes[j][k][i] * inverse_factorial[k + 1];
    return w;
}();

// Derivatives at node j of the polynomial `last_gram`.
constexpr auto gram_derivatives = [] {
    std::array<std::array<double, terms>, terms> d{};
    for (std::size_t j = 0; j < terms; ++j)
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t i = 0; i < terms; ++i) d[j][k] += through_nodes[j][k][i] * last_gram[i];
    return d;
}();

// c, derivatives in one unit of time, in another `ratio` times as long.
void rescale(double* c, std::size_t m, double ratio) {
    double power = 1.0;
    for (std::size_t k = 0; k < terms; ++k, power *= ratio)
        for (std::size_t r = 0; r < m; ++r) c[k * m + r] *= power;
}

// c a unit of time later.
void shift(double* c, std::size_t m) {
    for (std::size_t k = 0; k < terms; ++k)
        for (std::size_t j = k + 1; j < terms; ++j)
            for (std::size_t r = 0; r < m; ++r) c[k * m + r] += inverse_factorial[j - k] * c[j * m + r];
}

}  // namespace

Exponential::Exponential(Problem& problem, Size size, double rtol, Setup setup)
    : problem_(problem),
      size_(size),
      rtol_(rtol),
      setup_(setup),
      generator_(setup.inputs),
      reader_(setup.machine, setup.inputs, setup.layout, generator_, nothing_),
      states_(static_cast<std::size_t>(size.states)),
      one_(static_cast<std::size_t>(reader_.one())),
      next_level_(-first_halvings),
      z_(states_, 0.0),
      work_(static_cast<std::size_t>(size.quadratures), 0.0),
      weight_(states_, 0.0),
      powers_(nodes * work_.size(), 0.0),
      begin_work_(work_),
      guards_(nodes * static_cast<std::size_t>(size.guards), 1.0),
      rate_(states_, 0.0) {}

void Exponential::restart(double t, std::span<const double> atol, double quadrature_atol) {
    t_ = begin_ = t;
    atol_.assign(atol.begin(), atol.end());
    quadrature_atol_ = quadrature_atol;
    now_ = nullptr;
    older_rest_.clear();
    if (begun_) next_level_ -= after_switch;
    begun_ = false;
}

// What the machine's inputs do between nodes is known: nothing can be stepped over unseen, but for what laws make of it.
void Exponential::limit_step(double longest, double turning) {
    longest_ = std::min(longest, static_cast<double>(intervals) * turning);
}

// ------------------------------------------------------------------------------------------- modes

// The tangent in these modes, where they are met first. Other states may show more rows that the rest acts on.
void Exponential::take_modes() {
    auto& known = known_[setup_.modes];
    if (!known) {
        const exact::Matrix<double> A = reader_.tangent(setup_.modes, t_, z_.data()).A;
        ++counts_.jacobians;
        known = std::make_unique<exponential::Propagators>(A, driven_, setup_.grid);
    }
    now_ = known.get();
    linear_.assign(rows(), 0.0);
    scratch_.assign(2 * rows(), 0.0);
    probe_.assign(width(), 0.0);
    yc_.assign(nodes * width(), 0.0);
    before_.assign(nodes * rows(), 0.0);
    rest_.assign(nodes * driven_.size(), 0.0);
}

// The rest at a node, with powers and guards there. False where the laws give no number, or rows are driven that were not.
bool Exponential::evaluate(std::size_t node, const double* y, double* rest) {
    const double t = begin_ + static_cast<double>(node) * delta_;
    ++counts_.rhs;
    finite_ = problem_.rhs(t, y, rate_.data());
    if (!finite_) return false;
    now_->rates(y, linear_.data());
    std::size_t r = 0;
    for (std::size_t i = 0; i < states_; ++i) {
        const double n = rate_[i] - linear_[i];
        if (r < driven_.size() && driven_[r] == static_cast<int>(i))
            rest[r++] = n;
        else if (std::abs(n) * delta_ * weight_[i] > negligible) {
            driven_.insert(driven_.begin() + static_cast<std::ptrdiff_t>(r), static_cast<int>(i));
            more_driven_ = true;
            return false;
        }
    }
    return true;
}

void Exponential::set_inputs(std::size_t node) {
    const double t = begin_ + static_cast<double>(node) * delta_;
    const auto& knots = generator_.knots();
    const auto next = std::lower_bound(knots.begin(), knots.end(), t - instant(t));
    const bool on_knot = next != knots.end() && *next <= t + instant(t);
    generator_.set(on_knot ? *next : t, setup_.cell, column(node) + states_);
}

// ------------------------------------------------------------------------------------------- one step

Solver::Outcome Exponential::step(double stop) {
    begin_ = t_;
    const double left = stop - t_, least = shortest * std::max(std::abs(t_), std::abs(stop));
    if (left <= least) {
        t_ = stop;
        return Outcome::stopped;
    }
    begin_work_ = work_;
    int level = next_level_;
    const auto reach = [&] { return std::ldexp(setup_.grid, level) * static_cast<double>(intervals); };
    while (reach() > longest_ || reach() >= 2.0 * left) --level;
    const int wanted = level;
    double e = infinite;
    for (;;) {
        if (reach() <= least) return Outcome::failed;
        more_driven_ = false;
        e = try_step(level);
        if (more_driven_) {
            known_.clear();
            now_ = nullptr;
            older_rest_.clear();
            continue;
        }
        if (e <= 1.0) break;
        ++counts_.error_test_failures;
        level -= e < infinite ? std::max(1, static_cast<int>(std::ceil(std::log2(e) / order))) : levels_of_a_bad_number;
    }
    ++counts_.steps;
    begun_ = true;
    if (level < wanted)
        next_level_ = level;
    else if (e <= doubles && 2.0 * contraction_ <= slow && level == next_level_)
        ++next_level_;
    older_rest_ = rest_;
    older_begin_ = begin_;
    older_delta_ = delta_;
    look_at_guards();
    const double end = step_end(stop);
    const double* y = at(end);
    quadrature_at(end, work_.data());
    std::copy_n(y, states_, z_.begin());
    t_ = end;
    return end == stop ? Outcome::stopped : Outcome::stepped;
}

// A step ends with its last node, or where it passes `stop`; one that began off the grid ends on it.
double Exponential::step_end(double stop) const {
    const double whole = static_cast<double>(intervals) * delta_, end = begin_ + whole;
    if (end >= stop - instant(stop)) return stop;
    const double on_grid =
        setup_.start + std::floor((end + instant(end) - setup_.start) / setup_.grid) * setup_.grid;
    return on_grid - begin_ >= 0.5 * whole || std::abs(on_grid - end) <= instant(end) ? on_grid : end;
}

double Exponential::try_step(int level) {
    if (level != level_) contraction_ *= std::ldexp(1.0, level - level_);
    level_ = level;
    delta_ = std::ldexp(setup_.grid, level);
    for (std::size_t i = 0; i < states_; ++i) weight_[i] = 1.0 / (atol_[i] + rtol_ * std::abs(z_[i]));
    if (!now_) take_modes();
    std::copy(z_.begin(), z_.end(), column(0));
    column(0)[one_] = 1.0;
    set_inputs(0);
    if (!predict()) return infinite;
    for (std::size_t i = 0; i < states_; ++i)
        weight_[i] = 1.0 / (atol_[i] + rtol_ * std::max(std::abs(z_[i]), std::abs(column(intervals)[i])));
    double moved = sweep();
    for (int k = 0; !(moved * std::max(contraction_, least_contraction) <= enough); ++k) {
        if (k == most_sweeps || !(moved < infinite) || !evaluate_nodes()) return infinite;
        const double next = sweep();
        contraction_ = next / moved;
        if (!(contraction_ < slow) && next > enough) return infinite;
        moved = next;
    }
    return std::max({interpolation_error(), work_error(), inner_share * defect()});
}

// An exponential Adams–Bashforth method from node to node (S. Nørsett, 1969; M. Hochbruck, A. Ostermann, BIT 51 (2011)
// 889–908), by as many values as are known, those of the step before included.
bool Exponential::predict() {
    const std::size_t m = driven_.size();
    const double* const M = now_->step(level_);
    std::vector<double> values(most_back * m);  // of the past, the latest first
    std::size_t known = 0;
    if (!older_rest_.empty())
        while (known + 1 < most_back && begin_ - static_cast<double>(known + 1) * delta_ >= older_begin_ - instant(begin_)) {
            for (std::size_t r = 0; r < m; ++r) values[known * m + r] = past(static_cast<double>(known + 1), r);
            ++known;
        }
    if (!evaluate(0, column(0), rest_.data())) return false;
    for (std::size_t j = 0; j < intervals; ++j) {
        double* const c = column(j) + rows();
        const std::size_t p = std::min(most_back, j + 1 + known);
        for (std::size_t k = 0; k < p; ++k)
            for (std::size_t r = 0; r < m; ++r) {
                double sum = 0.0;
                for (std::size_t i = 0; i < p; ++i)
                    sum += backward[p - 1][k][i] * (i <= j ? rest_[(j - i) * m + r] : values[(i - j - 1) * m + r]);
                c[k * m + r] = sum;
            }
        exact::kernels().multiply(now_->rows(), static_cast<int>(rows() + p * m), M, now_->width(), column(j), 1,
                                  column(j + 1));
        if (knotted()) set_inputs(j + 1);
        if (!evaluate(j + 1, column(j + 1), rest_.data() + (j + 1) * m)) return false;
    }
    return true;
}

// The rest of the step before, so many places back.
double Exponential::past(double places, std::size_t row) const {
    const double x = (begin_ - places * delta_ - older_begin_) / older_delta_;
    const std::size_t m = driven_.size();
    double above = 0.0, below = 0.0;  // the barycentric formula; its weights are last_gram
    for (std::size_t i = 0; i < nodes; ++i) {
        const double apart = x - static_cast<double>(i);
        if (std::abs(apart) < 1e-9) return older_rest_[i * m + row];
        above += last_gram[i] / apart * older_rest_[i * m + row];
        below += last_gram[i] / apart;
    }
    return above / below;
}

void Exponential::expand(const Vector& values, std::size_t width, std::size_t node, double* c) const {
    for (std::size_t k = 0; k < terms; ++k)
        for (std::size_t r = 0; r < width; ++r) {
            double sum = 0.0;
            for (std::size_t i = 0; i < nodes; ++i) sum += through_nodes[node][k][i] * values[i * width + r];
            c[k * width + r] = sum;
        }
}

// The states again, by the polynomial through all values of the rest; returns how far they moved.
double Exponential::sweep() {
    const std::size_t m = driven_.size();
    const double* const M = now_->step(level_);
    Vector apart(states_);
    double most = 0.0;
    for (std::size_t j = 0; j < intervals; ++j) {
        expand(rest_, m, j, column(j) + rows());
        double* const next = column(j + 1);
        std::copy_n(next, states_, before_.begin());
        exact::kernels().multiply(now_->rows(), now_->width(), M, now_->width(), column(j), 1, next);
        if (knotted()) set_inputs(j + 1);
        for (std::size_t i = 0; i < states_; ++i) apart[i] = next[i] - before_[i];
        most = std::max(most, norm(apart.data()));
    }
    return most;
}

bool Exponential::evaluate_nodes() {
    for (std::size_t j = 1; j < nodes; ++j)
        if (!evaluate(j, column(j), rest_.data() + j * driven_.size())) return false;
    return true;
}

double Exponential::norm(const double* y) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < states_; ++i) sum += weight_[i] * y[i] * weight_[i] * y[i];
    return std::isfinite(sum) ? std::sqrt(sum / static_cast<double>(states_)) : infinite;
}

// ------------------------------------------------------------------------------------------- errors

// What the last of the polynomials that are orthogonal over the nodes, as far as the rest holds it, does to the states.
double Exponential::interpolation_error() {
    const std::size_t m = driven_.size();
    const double* const M = now_->step(level_);
    Vector share(m, 0.0), e(width(), 0.0), next(rows());
    for (std::size_t r = 0; r < m; ++r) {
        for (std::size_t i = 0; i < nodes; ++i) share[r] += last_gram[i] * rest_[i * m + r];
        share[r] /= exponential::last_gram_square;
    }
    double most = 0.0;
    for (std::size_t j = 0; j < intervals; ++j) {
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t r = 0; r < m; ++r) e[rows() + k * m + r] = gram_derivatives[j][k] * share[r];
        exact::kernels().multiply(now_->rows(), now_->width(), M, now_->width(), e.data(), 1, next.data());
        std::copy(next.begin(), next.end(), e.begin());
        most = std::max(most, norm(e.data()));
    }
    return most;
}

// How far the polynomial is from the rest between the first two nodes, over the time between them: there it fits worst,
// and something fast that dies away is seen.
double Exponential::defect() {
    const std::size_t m = driven_.size();
    if (m == 0) return 0.0;
    Vector half(column(0), column(0) + width()), y(rows()), rest(m), apart(states_, 0.0);
    rescale(half.data() + rows(), m, 0.5);
    exact::kernels().multiply(now_->rows(), now_->width(), now_->step(level_ - 1), now_->width(), half.data(), 1,
                              y.data());
    shift(half.data() + rows(), m);
    const double begin = begin_;
    begin_ += 0.5 * delta_;
    const bool evaluated = evaluate(0, y.data(), rest.data());
    begin_ = begin;
    if (!evaluated) return infinite;
    for (std::size_t r = 0; r < m; ++r)
        apart[static_cast<std::size_t>(driven_[r])] = delta_ * (rest[r] - half[rows() + r]);
    return norm(apart.data());
}

double Exponential::work_error() const { return 0.0; }

void Exponential::look_at_guards() { keeps_off_ = false; }

// ------------------------------------------------------------------------------------------- inside a step

// y there, in `probe_` unless it is stored.
const double* Exponential::at(double t) const {
    const std::size_t m = driven_.size();
    const auto node = static_cast<std::size_t>(
        std::clamp(std::floor((t - begin_) / delta_ + 1e-9), 0.0, static_cast<double>(intervals)));
    double rest = t - (begin_ + static_cast<double>(node) * delta_);
    if (rest <= instant(t) || node == intervals) return column(node);
    std::copy_n(column(node), width(), probe_.begin());
    double* const c = probe_.data() + rows();
    double unit = delta_;
    for (int level = level_ - 1; level >= now_->finest() && rest > instant(t); --level) {
        const double part = std::ldexp(setup_.grid, level);
        if (rest < part - instant(t)) continue;
        rescale(c, m, part / unit);
        unit = part;
        exact::kernels().multiply(now_->rows(), now_->width(), now_->step(level), now_->width(), probe_.data(), 1,
                                  scratch_.data());
        std::copy_n(scratch_.begin(), rows(), probe_.begin());
        shift(c, m);
        rest -= part;
    }
    if (rest > instant(t)) {
        rescale(c, m, rest / unit);
        now_->taylor(rest, probe_.data(), scratch_.data());
    }
    return probe_.data();
}

void Exponential::state_at(double t, double* z) const {
    if (t == t_ || t_ == begin_)
        std::copy(z_.begin(), z_.end(), z);
    else
        std::copy_n(at(t), states_, z);
}

void Exponential::quadrature_at(double, double* q) const { std::copy(work_.begin(), work_.end(), q); }

void Exponential::go_back(double t) {
    quadrature_at(t, work_.data());
    const double* y = at(t);
    std::copy_n(y, states_, z_.begin());
    t_ = t;
}

Solver::Failure Exponential::failure() const {
    if (!finite_) return {false, not_finite};
    return {true,
            "the step size fell to nothing; look for a law or a motion that goes to infinity here, or a law that is "
            "stiff beside the linear part, or try engine = cvode with method = bdf"};
}

}  // namespace dualdrive
