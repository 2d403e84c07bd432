// The first fall of a guard through zero within a step, from the guard's own power series.
//
// Most steps are judged by a quintic through both ends, whose distance from the guard is bounded; only where that leaves a
// doubt the series is put into Bernstein form, whose coefficients enclose it: none below zero proves that there is no
// crossing; one change of sign proves that there is exactly one; anything else is halved. No sampling, no heuristics.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace dualdrive::exact {

inline constexpr int most_terms = 48;  // of a guard's power series over one step

enum class Verdict { none, one, unclear };

// The quintic with a guard's values, slopes and curvatures at both ends of a step, as Bernstein coefficients b. It differs
// from the guard by at most M/46080, its slope by at most √5 M/30000, M the largest sixth derivative over the step taken as
// unit (P. Ciarlet, M. Schultz, R. Varga, 1967).
template <class R>
struct Quintic {
    std::array<R, 6> b;

    Verdict judge(R sixth, R noise) const {
        const R error = sixth / R(46080) + noise;
        if (*std::min_element(b.begin(), b.end()) > error) return Verdict::none;
        const R slope_error = R(2.23606797749979) * sixth / R(30000) + noise;
        R steepest = b[1] - b[0];
        for (std::size_t i = 1; i < 5; ++i) steepest = std::max(steepest, b[i + 1] - b[i]);
        return b[0] > error && b[5] < -error && R(5) * steepest < -slope_error ? Verdict::one : Verdict::unclear;
    }

    // The same for a guard that stands at zero at the begin: with that root divided out the quintic has the coefficients
    // 5 b_i / i, and its error is at most M max x² (1 − x)³ / 720.
    bool leaves_zero(R sixth, R noise) const {
        R least = R(5) * b[1];
        for (std::size_t i = 2; i < 6; ++i) least = std::min(least, R(5) * b[i] / R(i));
        return least > R(0.03456) * sixth / R(720) + noise;
    }

    // Where the quintic falls through zero, if it does so once: a start for Newton's method.
    R root() const {
        R low(0), high(1), x = b[0] / (b[0] - b[5]);
        for (int pass = 0; pass < 6; ++pass) {
            std::array<R, 6> c = b;
            for (int level = 5; level > 1; --level)
                for (int i = 0; i < level; ++i)
                    c[static_cast<std::size_t>(i)] +=
                        x * (c[static_cast<std::size_t>(i + 1)] - c[static_cast<std::size_t>(i)]);
            const R value = c[0] + x * (c[1] - c[0]), slope = R(5) * (c[1] - c[0]);
            (value > 0 ? low : high) = x;
            const R next = x - value / slope;
            if (!(next > low && next < high)) return x;
            if (std::abs(next - x) < R(1e-4)) return next;  // the quintic itself is hardly better
            x = next;
        }
        return x;
    }
};

static_assert(most_terms % 4 == 0);
inline constexpr std::array<double, most_terms> sixth_factors = [] {  // k (k − 1) ... (k − 5)
    std::array<double, most_terms> f{};
    for (int k = 6; k < most_terms; ++k)
        f[static_cast<std::size_t>(k)] = 1.0 * k * (k - 1) * (k - 2) * (k - 3) * (k - 4) * (k - 5);
    return f;
}();

// The largest sixth derivative over the unit interval, from a power series that zeros fill up to a multiple of four.
template <class R>
R sixth_derivative(const R* series, int terms) {
    std::array<R, 4> sum{};
    for (int k = 4; k < terms; k += 4)
        for (int j = 0; j < 4; ++j)
            sum[static_cast<std::size_t>(j)] +=
                std::abs(series[k + j]) * R(sixth_factors[static_cast<std::size_t>(k + j)]);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

// How many terms are left of a series when what is far below its rounding is dropped.
template <class R>
int terms_above(const R* series, int terms, R negligible) {
    R dropped(0);
    while (terms > 2 && (dropped += std::abs(series[terms - 1])) <= negligible) --terms;
    return terms;
}

// The one root of a falling series near `x`: Halley's method, kept inside the interval by bisection.
template <class R>
R polish_root(const R* series, int terms, R x, R low = R(0), R high = R(1)) {
    constexpr R unit = std::numeric_limits<R>::epsilon();
    for (int pass = 0; pass < 100; ++pass) {
        R value(0), slope(0), bend(0);  // bend: half the second derivative
        for (int k = terms - 1; k >= 0; --k) {
            bend = bend * x + slope;
            slope = slope * x + value;
            value = value * x + series[k];
        }
        (value > 0 ? low : high) = x;
        const R newton = -value / slope, curved = bend / slope;
        R next = x + newton / (R(1) + newton * curved);
        const bool inside = slope < 0 && next > low && next < high;
        if (!inside) next = low + (high - low) / 2;
        const R moved = std::abs(next - x);
        x = next;
        // The next step would move by about the cube of this one.
        const R rest = (R(100) + curved * curved) * moved * moved * moved;
        if ((inside && rest <= unit) || moved <= 2 * unit * x || !(high > low)) break;
    }
    return x;
}

template <class R>
class FirstFall {
  public:
    // series: value Σ series[k] x^k for 0 ≤ x ≤ 1; noise: what of it is rounding. `on_surface`: whatever the value at 0,
    // the guard stands at zero there.
    FirstFall(const R* series, int terms, R noise, bool on_surface) : noise_(noise) {
        std::copy_n(series, terms, p_.begin());
        if (on_surface || std::abs(p_[0]) <= noise) {  // the root one starts on is divided out
            const R zero = on_surface ? R(of_state) * noise : noise;
            first_ = 1;
            while (first_ < terms && std::abs(p_[static_cast<std::size_t>(first_)]) <= zero) ++first_;
            // What is too small to be a fall may still be a rise, which puts off the fall that follows.
            for (int k = first_ - 1; k > 0; --k) {
                R& small = p_[static_cast<std::size_t>(k)];
                small = std::max(small, R(0));
                if (small > 0) first_ = k;
            }
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
    // Where something breaks away its speed and its acceleration are zero, but for the rounding that the state brought
    // along from the step before: more than a series of its own has. A slope of that size is no fall.
    static constexpr double of_state = 1000.0;

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
        if (changes == 1 && b[0] >= 0)
            return polish_root(p_.data() + first_, degree_ + 1, low + (high - low) / 2, low, high);
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

    std::array<R, most_terms> p_{};
    R noise_;
    int first_ = 0, degree_ = 0;
};

}  // namespace dualdrive::exact
