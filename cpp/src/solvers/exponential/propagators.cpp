#include "propagators.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "../exact/kernels.hpp"
#include "../exact/propagator.hpp"

namespace dualdrive::exponential {

namespace {

constexpr double widest = 0.5;  // of ‖A‖ δ at the finest level: beyond it a level more costs less than more terms
constexpr int most_levels = 64;
constexpr int terms = static_cast<int>(nodes);

}  // namespace

Propagators::Propagators(const exact::Matrix<double>& A, const std::vector<int>& driven, double unit)
    : unit_(unit),
      driven_(driven),
      n_(static_cast<int>(A.rows())),
      rows_(exact::padded(n_)),
      m_(static_cast<int>(driven.size())),
      width_(rows_ + terms * m_),
      A_(static_cast<std::size_t>(rows_ * n_), 0.0) {
    if (!A.allFinite()) throw std::domain_error("a coefficient of the linearised equations is not finite");
    for (int j = 0; j < n_; ++j)
        for (int i = 0; i < n_; ++i) A_[static_cast<std::size_t>(j * rows_ + i)] = A(i, j);
    const double norm = exact::spectral_bound<double>(A);
    while (norm * std::ldexp(unit_, finest_) > widest && finest_ > -most_levels) --finest_;
    order_ = exact::terms_for<double>(norm * std::ldexp(unit_, finest_));
    known_.emplace(finest_, first(std::ldexp(unit_, finest_)));
}

// M x of `count` columns.
std::vector<double> Propagators::times(const std::vector<double>& M, const double* x, int count) const {
    std::vector<double> product(static_cast<std::size_t>(rows_ * count));
    exact::kernels().product(rows_, n_, M.data(), rows_, x, count, product.data());
    return product;
}

void Propagators::put_exponential(Step& step) const {
    std::copy(step.less_one.begin(), step.less_one.end(), step.whole.begin());
    for (int i = 0; i < n_; ++i) step.whole[static_cast<std::size_t>(i * rows_ + i)] += 1.0;
}

// With X = A δ: F = e^X − 1 by Horner's rule, F ← (X + X F)/k. The last φ from its series, φ_k = Σ_i X^i/(i + k)!, those
// before it by φ_k = X φ_{k+1} + 1/k!.
Propagators::Step Propagators::first(double length) const {
    std::vector<double> X = A_;
    for (double& x : X) x *= length;
    Step step{std::vector<double>(X.size(), 0.0), std::vector<double>(static_cast<std::size_t>(rows_ * width_), 0.0)};
    for (int k = order_; k > 0; --k) {
        step.less_one = times(X, step.less_one.data(), n_);
        for (std::size_t i = 0; i < X.size(); ++i) step.less_one[i] = (step.less_one[i] + X[i]) / k;
    }
    put_exponential(step);
    if (m_ == 0) return step;
    std::vector<double> phi(static_cast<std::size_t>(rows_ * m_), 0.0);
    double factorial = std::tgamma(terms + order_ + 1.0);
    const auto next = [&] {
        phi = times(X, phi.data(), m_);
        for (int r = 0; r < m_; ++r)
            phi[static_cast<std::size_t>(r * rows_ + driven_[static_cast<std::size_t>(r)])] += 1.0 / factorial;
    };
    for (int k = terms + order_; k > 0; --k) {
        next();
        if (k <= terms)
            std::transform(phi.begin(), phi.end(), step.whole.begin() + rows_ * (rows_ + m_ * (k - 1)),
                           [&](double p) { return length * p; });
        factorial /= k;
    }
    return step;
}

// F ← 2 F + F². With Φ_k = δ φ_{k+1}(A δ) B, and c_k over the second half Σ_j c_j/(j − k)!, in units of the whole step
//     Φ_k ← 2^{−k} (e^{A δ} Φ_k + Σ_{j ≤ k} Φ_j/(k − j)!)
Propagators::Step Propagators::doubled(const Step& half) const {
    const std::size_t block = static_cast<std::size_t>(rows_ * m_);
    Step step{times(half.less_one, half.less_one.data(), n_), std::vector<double>(half.whole.size(), 0.0)};
    for (std::size_t i = 0; i < step.less_one.size(); ++i) step.less_one[i] += 2.0 * half.less_one[i];
    put_exponential(step);
    const double* old = half.whole.data() + rows_ * rows_;
    double* whole = step.whole.data() + rows_ * rows_;
    const std::vector<double> moved = times(half.less_one, old, terms * m_);
    for (std::size_t k = 0; k < nodes; ++k) {
        double inverse = 1.0;  // of (k − j)!
        for (std::size_t back = 0; back <= k; inverse /= static_cast<double>(++back))
            for (std::size_t i = 0; i < block; ++i) whole[k * block + i] += inverse * old[(k - back) * block + i];
        const double scale = std::ldexp(1.0, -static_cast<int>(k));
        for (std::size_t i = 0; i < block; ++i)
            whole[k * block + i] = scale * (whole[k * block + i] + old[k * block + i] + moved[k * block + i]);
    }
    return step;
}

const double* Propagators::step(int level) {
    if (const auto known = known_.find(level); known != known_.end()) return known->second.whole.data();
    if (level < finest_) return known_.emplace(level, first(std::ldexp(unit_, level))).first->second.whole.data();
    step(level - 1);
    return known_.emplace(level, doubled(known_.at(level - 1))).first->second.whole.data();
}

const std::vector<double>& Propagators::less_one(int level) {
    step(level);
    return known_.at(level).less_one;
}

void Propagators::rates(const double* y, double* out) const {
    exact::kernels().multiply(rows_, n_, A_.data(), rows_, y, 1, out);
}

double Propagators::largest_term(int row, const double* y) const {
    double largest = 0.0;
    for (int j = 0; j < n_; ++j)
        largest = std::max(largest, std::abs(A_[static_cast<std::size_t>(j * rows_ + row)] * y[j]));
    return largest;
}

// v_i = r^i y⁽ⁱ⁾/i!: v_{i+1} = r A v_i/(i + 1) + r c_i/(i + 1)!
void Propagators::taylor(double length, double* yc, double* scratch) const {
    double *term = scratch, *next = scratch + rows_;
    std::copy_n(yc, rows_, term);
    double factorial = 1.0;
    for (int i = 0; i < std::max(order_, terms); ++i) {
        rates(term, next);
        factorial *= i + 1;
        for (int k = 0; k < rows_; ++k) next[k] *= length / (i + 1);
        for (int r = 0; r < m_ && i < terms; ++r)
            next[driven_[static_cast<std::size_t>(r)]] += length * yc[rows_ + i * m_ + r] / factorial;
        for (int k = 0; k < rows_; ++k) yc[k] += next[k];
        std::swap(term, next);
    }
}

}  // namespace dualdrive::exponential
