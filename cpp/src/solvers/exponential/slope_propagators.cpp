#include "slope_propagators.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "../exact/kernels.hpp"

namespace dualdrive::exponential {

namespace {

constexpr int terms = static_cast<int>(nodes);

}  // namespace

SlopePropagators::SlopePropagators(Propagators& propagators, std::vector<Slope> slopes)
    : propagators_(propagators),
      slopes_(std::move(slopes)),
      n_(propagators.size()),
      rows_(propagators.rows()),
      m_(static_cast<int>(propagators.driven().size())),
      width_(propagators.width()),
      moved_(static_cast<std::size_t>(rows_)) {
    for (std::size_t p = 0; p < slopes_.size(); ++p)
        if (!slopes_[p].empty()) moving_.push_back(p);
}

SlopePropagators::Packed SlopePropagators::times(const double* M, const double* x, int count) const {
    Packed product(static_cast<std::size_t>(rows_ * count));
    exact::kernels().product(rows_, n_, M, rows_, x, count, product.data());
    return product;
}

// out += factor A_p x of `count` columns.
void SlopePropagators::add_product(const Slope& slope, double factor, const double* x, int count, Packed& out) const {
    for (const Entry& e : slope)
        for (int c = 0; c < count; ++c)
            out[static_cast<std::size_t>(c * rows_ + e.row)] += factor * e.value * x[c * rows_ + e.column];
}

void SlopePropagators::add_rates(const double* y, double* out, std::size_t apart) const {
    for (const std::size_t p : moving_)
        for (const Entry& e : slopes_[p]) out[p * apart + static_cast<std::size_t>(e.row)] += e.value * y[e.column];
}

void SlopePropagators::largest_terms(const double* y, double* sizes, std::size_t apart) const {
    for (const std::size_t p : moving_)
        for (const Entry& e : slopes_[p]) {
            double& size = sizes[p * apart + static_cast<std::size_t>(e.row)];
            size = std::max(size, std::abs(e.value * y[e.column]));
        }
}

void SlopePropagators::add_step(int level, const double* yc, double* S, std::size_t apart) {
    const std::vector<Packed>& all = step(level);
    for (std::size_t k = 0; k < moving_.size(); ++k) {
        exact::kernels().multiply(rows_, width_, all[k].data(), width_, yc, 1, moved_.data());
        double* const s = S + moving_[k] * apart;
        for (int r = 0; r < rows_; ++r) s[r] += moved_[static_cast<std::size_t>(r)];
    }
}

const std::vector<SlopePropagators::Packed>& SlopePropagators::step(int level) {
    if (const auto known = known_.find(level); known != known_.end()) return known->second;
    std::vector<Packed> found;
    const int finest = propagators_.finest();
    if (level <= finest) {
        const double length = std::ldexp(propagators_.unit(), level);
        for (const std::size_t p : moving_) found.push_back(first(length, slopes_[p]));
    } else {
        for (const Packed& half : step(level - 1)) found.push_back(doubled(level - 1, half));
    }
    return known_.emplace(level, std::move(found)).first->second;
}

// Horner's rules of Propagators::first, F ← (X + X F)/k and φ_k = X φ_{k+1} + 1/k!, and their derivatives beside them.
SlopePropagators::Packed SlopePropagators::first(double length, const Slope& slope) const {
    Packed X = propagators_.A(), F(X.size(), 0.0), L(X.size(), 0.0);
    for (double& x : X) x *= length;
    for (int k = propagators_.order(); k > 0; --k) {
        L = times(X.data(), L.data(), n_);
        add_product(slope, length, F.data(), n_, L);
        for (const Entry& e : slope) L[static_cast<std::size_t>(e.column * rows_ + e.row)] += length * e.value;
        F = times(X.data(), F.data(), n_);
        for (std::size_t i = 0; i < X.size(); ++i) {
            L[i] /= k;
            F[i] = (F[i] + X[i]) / k;
        }
    }
    Packed whole(static_cast<std::size_t>(rows_ * width_), 0.0);
    std::copy(L.begin(), L.end(), whole.begin());
    if (m_ == 0) return whole;
    const int last = terms + propagators_.order();
    Packed phi(static_cast<std::size_t>(rows_ * m_), 0.0), slopes(phi);
    double factorial = std::tgamma(last + 1.0);
    for (int k = last; k > 0; factorial /= k, --k) {
        slopes = times(X.data(), slopes.data(), m_);
        add_product(slope, length, phi.data(), m_, slopes);
        phi = times(X.data(), phi.data(), m_);
        for (int r = 0; r < m_; ++r)
            phi[static_cast<std::size_t>(r * rows_ + propagators_.driven()[static_cast<std::size_t>(r)])] +=
                1.0 / factorial;
        if (k <= terms)
            std::transform(slopes.begin(), slopes.end(), whole.begin() + rows_ * (rows_ + m_ * (k - 1)),
                           [&](double p) { return length * p; });
    }
    return whole;
}

// From `level` to the one above it, Propagators::doubled derived:
//     F ← 2 F + F²,   Φ_k ← 2^{−k} (Φ_k + F Φ_k + Σ_{j ≤ k} Φ_j/(k − j)!)
SlopePropagators::Packed SlopePropagators::doubled(int level, const Packed& half) {
    const Packed& F = propagators_.less_one(level);
    const double* const phi = propagators_.step(level) + rows_ * rows_;
    Packed whole(half.size(), 0.0);
    const Packed right = times(half.data(), F.data(), n_), left = times(F.data(), half.data(), n_);
    for (std::size_t i = 0; i < right.size(); ++i) whole[i] = 2.0 * half[i] + right[i] + left[i];
    const auto block = static_cast<std::size_t>(rows_ * m_), begin = static_cast<std::size_t>(rows_ * rows_);
    const double* const old = half.data() + begin;
    double* const out = whole.data() + begin;
    const Packed by_phi = times(half.data(), phi, terms * m_), moved = times(F.data(), old, terms * m_);
    for (std::size_t k = 0; k < nodes; ++k) {
        double inverse = 1.0;  // of (k − j)!
        for (std::size_t back = 0; back <= k; inverse /= static_cast<double>(++back))
            for (std::size_t i = 0; i < block; ++i) out[k * block + i] += inverse * old[(k - back) * block + i];
        const double scale = std::ldexp(1.0, -static_cast<int>(k));
        for (std::size_t i = k * block; i < (k + 1) * block; ++i)
            out[i] = scale * (out[i] + old[i] + by_phi[i] + moved[i]);
    }
    return whole;
}

// v_{i+1} = r A v_i/(i + 1) + r B c_i/(i + 1)!, and s_{i+1} = r (A s_i + A_p v_i)/(i + 1) + r B c_i/(i + 1)! with its own c.
void SlopePropagators::taylor(double length, double* yc, double* columns, int count) const {
    const auto apart = static_cast<std::size_t>(width_), tall = static_cast<std::size_t>(rows_),
               all = static_cast<std::size_t>(count) + 1;
    const auto column = [&](std::size_t k) { return k == 0 ? yc : columns + (k - 1) * apart; };
    Packed term(tall * all), next(tall * all);
    for (std::size_t k = 0; k < all; ++k) std::copy_n(column(k), tall, term.begin() + static_cast<long>(k * tall));
    double factorial = 1.0;
    for (int i = 0; i < std::max(propagators_.order(), terms); ++i) {
        exact::kernels().product(rows_, n_, propagators_.A().data(), rows_, term.data(), static_cast<int>(all),
                                 next.data());
        add_rates(term.data(), next.data() + tall, tall);
        factorial *= i + 1;
        for (double& x : next) x *= length / (i + 1);
        for (std::size_t k = 0; k < all; ++k) {
            double* const own = next.data() + k * tall;
            for (int r = 0; r < m_ && i < terms; ++r)
                own[propagators_.driven()[static_cast<std::size_t>(r)]] +=
                    length * column(k)[rows_ + i * m_ + r] / factorial;
            for (std::size_t r = 0; r < tall; ++r) column(k)[r] += own[r];
        }
        term.swap(next);
    }
}

}  // namespace dualdrive::exponential
