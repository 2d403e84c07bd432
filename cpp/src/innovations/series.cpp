// Stretches of time without a propagator: Taylor series of ẏ = A y + n, as far as their terms matter.
#include <algorithm>
#include <cmath>

#include "../solvers/exact/kernels.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

constexpr int most_terms = 80;
constexpr double least_term = 1e-13;  // of a series over a little time

}  // namespace

// What the laws add to the tangent at (t, y): the rates less A y.
void Flow::remainder(double t, const double* y, double* n) {
    evaluate(t, y);
    exact::kernels().multiply(exact::padded(n_), n_, now_->packed.data(), n_, y, 1, n);
    for (int k = 0; k < states(); ++k) n[k] = model_.rate()[static_cast<std::size_t>(k)] - n[k];
    for (int k = states(); k < n_; ++k) n[k] = 0.0;
    for (int b = 0; b < disturbance_count(); ++b)
        for (int k = 0; k < states(); ++k) n[k] += now_->creep(k, b) * y[first_disturbance() + b];
}

// The Taylor series over `length` from y on of ẏ = A y + n0 + slope s/length, in fractions of the length, of as many terms as
// the spectral radius asks for. One series serves all looks at a stretch of time.
void Flow::expand(const double* y, const double* n0, const double* slope, double length) {
    const double theta = now_->bound * length;
    order_ = 2;
    for (double term = theta; order_ < most_terms && (term > 1e-16 || order_ < theta); ++order_) term *= theta / order_;
    const auto rows = static_cast<std::size_t>(exact::padded(n_));
    terms_.resize(rows * static_cast<std::size_t>(most_terms + 1));
    falling_.resize(most_terms + 1);
    std::fill_n(terms_.data(), rows, 0.0);
    std::copy_n(y, n_, terms_.data());
    if (!n0)
        return exact::kernels().series(static_cast<int>(rows), n_, now_->packed.data(), length, order_, terms_.data());
    for (int k = 1; k <= order_; ++k) {
        const double* term = terms_.data() + static_cast<std::size_t>(k - 1) * rows;
        double* next = terms_.data() + static_cast<std::size_t>(k) * rows;
        exact::kernels().multiply(static_cast<int>(rows), n_, now_->packed.data(), n_, term, 1, next);
        for (int i = 0; k == 1 && i < n_; ++i) next[i] += n0[i];
        for (int i = 0; k == 2 && slope && i < n_; ++i) next[i] += slope[i];
        for (int i = 0; i < n_; ++i) next[i] *= length / k;
    }
}

void Flow::at(double fraction, double* y) const {
    const auto rows = static_cast<std::size_t>(exact::padded(n_));
    const double* term = terms_.data() + static_cast<std::size_t>(order_) * rows;
    std::copy_n(term, n_, y);
    for (int k = order_; k-- > 0;) {
        term -= rows;
        for (int i = 0; i < n_; ++i) y[i] = term[i] + fraction * y[i];
    }
}

// ẏ = A y + n by its series, over so little that few terms serve.
void Flow::go_a_little(double length) {
    const auto rows = static_cast<std::size_t>(exact::padded(n_)), n = static_cast<std::size_t>(n_);
    little_.assign(2 * rows, 0.0);
    double *term = little_.data(), *next = term + rows;
    std::copy_n(y_.data(), n, term);
    const double reach = now_->bound * std::abs(length);
    double size = 1.0;
    for (int k = 1; k < most_terms && (size > least_term || k < 3); ++k) {
        exact::kernels().multiply(static_cast<int>(rows), n_, now_->packed.data(), n_, term, 1, next);
        for (std::size_t j = 0; k == 1 && j < driven_.size(); ++j)
            next[static_cast<std::size_t>(driven_[j])] += y_[n + j];
        for (std::size_t j = 0; j < n; ++j) next[j] *= length / k;
        for (std::size_t j = 0; j < n; ++j) y_[j] += next[j];
        std::swap(term, next);
        size *= reach / k;
    }
}

}  // namespace dualdrive::innovations
