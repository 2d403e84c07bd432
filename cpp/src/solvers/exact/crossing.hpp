// The first fall of a guard through zero within a step, from the guard's own power series.
//
// The series is put into Bernstein form, whose coefficients enclose it: none below zero proves that there is no
// crossing; one change of sign proves that there is exactly one; anything else is halved. No sampling, no heuristics.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace dualdrive::exact {

inline constexpr int most_terms = 48;  // of a guard's power series over one step

template <class R>
class FirstFall {
  public:
    // series: value Σ series[k] x^k for 0 ≤ x ≤ 1; noise: what of it is rounding. `on_surface`: whatever the value at 0,
    // the guard stands at zero there.
    FirstFall(const R* series, int terms, R noise, bool on_surface) : noise_(noise) {
        std::copy_n(series, terms, p_.begin());
        if (on_surface || std::abs(p_[0]) <= noise) {  // the root one starts on is divided out
            while (first_ < terms && (std::abs(p_[static_cast<std::size_t>(first_)]) <= noise || first_ == 0)) ++first_;
        }
        degree_ = terms - 1 - first_;
    }

    // Where it falls below zero first, or nothing.
    std::optional<R> find() const {
        if (degree_ < 0) return std::nullopt;  // zero throughout
        if (coefficient(0) < 0) return R(0);
        Coefficients b;
        for (int j = 0; j <= degree_; ++j) b[static_cast<std::size_t>(j)] = coefficient(j);
        to_bernstein(b);
        return search(b, R(0), R(1), deepest);
    }

  private:
    using Coefficients = std::array<R, most_terms>;
    static constexpr int deepest = 48;

    R coefficient(int k) const { return p_[static_cast<std::size_t>(first_ + k)]; }

    // b_i = Σ_j C(i, j)/C(n, j) a_j, by sums alone.
    void to_bernstein(Coefficients& b) const {
        R binomial(1);
        for (int j = 1; j <= degree_; ++j) {
            binomial *= R(degree_ - j + 1) / R(j);
            b[static_cast<std::size_t>(j)] /= binomial;
        }
        for (int pass = 1; pass <= degree_; ++pass)
            for (int i = degree_; i >= pass; --i) b[static_cast<std::size_t>(i)] += b[static_cast<std::size_t>(i - 1)];
    }

    std::optional<R> search(const Coefficients& b, R low, R high, int depth) const {
        int changes = 0;
        bool below = false;
        for (int i = 0; i <= degree_; ++i) {
            const R now = b[static_cast<std::size_t>(i)];
            below = below || now < -noise_;
            if (i > 0) changes += (now < 0) != (b[static_cast<std::size_t>(i - 1)] < 0);
        }
        if (!below) return std::nullopt;
        if (changes == 1 && b[0] >= 0) return root(low, high);
        if (depth == 0) return value(low + (high - low) / 2) < -noise_ ? std::optional<R>(low) : std::nullopt;
        Coefficients left = b, right = b;  // de Casteljau at the middle
        for (int pass = 1; pass <= degree_; ++pass) {
            for (int i = 0; i <= degree_ - pass; ++i)
                right[static_cast<std::size_t>(i)] =
                    (right[static_cast<std::size_t>(i)] + right[static_cast<std::size_t>(i + 1)]) / 2;
            left[static_cast<std::size_t>(pass)] = right[0];
        }
        const R middle = low + (high - low) / 2;
        if (const auto found = search(left, low, middle, depth - 1)) return found;
        if (right[0] < -noise_) return middle;
        return search(right, middle, high, depth - 1);
    }

    R value(R x) const {
        R v(0);
        for (int k = degree_; k >= 0; --k) v = v * x + coefficient(k);
        return v;
    }

    // The one root in the bracket: Newton, kept inside by bisection.
    R root(R low, R high) const {
        R x = low + (high - low) / 2;
        for (int pass = 0; pass < 100; ++pass) {
            R v(0), slope(0);
            for (int k = degree_; k >= 0; --k) {
                slope = slope * x + v;
                v = v * x + coefficient(k);
            }
            (v > 0 ? low : high) = x;
            R next = slope < 0 ? x - v / slope : low;
            if (!(next > low && next < high)) next = low + (high - low) / 2;
            const R moved = std::abs(next - x);
            x = next;
            if (moved <= 2 * std::numeric_limits<R>::epsilon() * x || !(high > low)) break;
        }
        return x;
    }

    std::array<R, most_terms> p_;
    R noise_;
    int first_ = 0, degree_ = 0;
};

}  // namespace dualdrive::exact
