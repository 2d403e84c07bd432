// Recorded signals: sample and hold, polygon, spline.
#include <utility>

#include "dualdrive/motion.hpp"
#include "refuse.hpp"

namespace dualdrive::motion {
namespace {

void check(const std::vector<double>& times, const std::vector<double>& values, std::size_t fewest) {
    if (times.size() != values.size())
        refuse("sampled: ", times.size(), " times and ", values.size(), " values: the two must be of one length");
    if (times.size() < fewest)
        refuse("sampled: ", times.size(), " samples: this interpolation needs at least ", fewest);
    require_increasing("sampled", "times", times);
    require_finite_list("sampled", "values", values);
}

Waveform staircase(const std::vector<double>& times, const std::vector<double>& values) {
    std::vector<Polynomial> pieces{Polynomial{values.front()}};
    for (const double value : values) pieces.push_back({value});
    return Waveform(times, pieces);
}

Waveform polygon(const std::vector<double>& times, const std::vector<double>& values) {
    std::vector<Polynomial> pieces{Polynomial{values.front()}};
    for (std::size_t k = 0; k + 1 < times.size(); ++k)
        pieces.push_back({values[k], (values[k + 1] - values[k]) / (times[k + 1] - times[k])});
    pieces.push_back({values.back()});
    return Waveform(times, pieces);
}

// A tridiagonal system, row k: below[k] x[k−1] + diagonal[k] x[k] + above[k] x[k+1] = right[k]; solved into `right`.
// Rows dominated by their diagonal need no pivoting.
void solve_tridiagonal(const std::vector<double>& below, std::vector<double> diagonal, const std::vector<double>& above,
                       std::vector<double>& right) {
    const std::size_t n = right.size();
    for (std::size_t k = 1; k < n; ++k) {
        const double ratio = below[k] / diagonal[k - 1];
        diagonal[k] -= ratio * above[k - 1];
        right[k] -= ratio * right[k - 1];
    }
    right[n - 1] /= diagonal[n - 1];
    for (std::size_t k = n - 1; k-- > 0;) right[k] = (right[k] - above[k] * right[k + 1]) / diagonal[k];
}

// Second derivatives M at the samples, from continuity of the first: with step h[k] and slope d[k] after sample k,
//     h[k−1] M[k−1] + 2 (h[k−1] + h[k]) M[k] + h[k] M[k+1] = 6 (d[k] − d[k−1]),
// and not-a-knot at either end: the third derivative is the same on the two outermost intervals, so that
// M[0] = M[1] + (M[1] − M[2]) h[0]/h[1], likewise at the other end (C. de Boor: A Practical Guide to Splines, ch. IV).
std::vector<double> curvatures(const std::vector<double>& h, const std::vector<double>& d) {
    const std::size_t samples = h.size() + 1;
    if (samples == 2) return {0.0, 0.0};                                                   // a straight line
    if (samples == 3) return std::vector<double>(3, 2.0 * (d[1] - d[0]) / (h[0] + h[1]));  // a parabola
    const std::size_t n = samples - 2;
    std::vector<double> below(n), diagonal(n), above(n), right(n);
    for (std::size_t k = 0; k < n; ++k) {
        below[k] = h[k];
        diagonal[k] = 2.0 * (h[k] + h[k + 1]);
        above[k] = h[k + 1];
        right[k] = 6.0 * (d[k + 1] - d[k]);
    }
    const double first = h[0] / h[1], last = h[n] / h[n - 1];
    diagonal[0] += h[0] * (1.0 + first);
    above[0] -= h[0] * first;
    diagonal[n - 1] += h[n] * (1.0 + last);
    below[n - 1] -= h[n] * last;
    solve_tridiagonal(below, std::move(diagonal), above, right);
    std::vector<double> m{right[0] + (right[0] - right[1]) * first};
    m.insert(m.end(), right.begin(), right.end());
    m.push_back(right[n - 1] + (right[n - 1] - right[n - 2]) * last);
    return m;
}

Waveform spline(const std::vector<double>& times, const std::vector<double>& values) {
    std::vector<double> h, d;
    for (std::size_t k = 0; k + 1 < times.size(); ++k) {
        h.push_back(times[k + 1] - times[k]);
        d.push_back((values[k + 1] - values[k]) / h.back());
    }
    const std::vector<double> m = curvatures(h, d);
    std::vector<Polynomial> pieces{Polynomial{values.front()}};
    for (std::size_t k = 0; k < h.size(); ++k)
        pieces.push_back(
            {values[k], d[k] - h[k] * (2.0 * m[k] + m[k + 1]) / 6.0, 0.5 * m[k], (m[k + 1] - m[k]) / (6.0 * h[k])});
    pieces.push_back({values.back()});
    return Waveform(times, pieces, std::vector<double>{times.front(), times.back()});
}

}  // namespace

Waveform sampled(const std::vector<double>& times, const std::vector<double>& values, Interpolation interpolation) {
    check(times, values, interpolation == Interpolation::hold ? 1 : 2);
    switch (interpolation) {
        case Interpolation::hold:
            return staircase(times, values);
        case Interpolation::linear:
            return polygon(times, values);
        default:
            return spline(times, values);
    }
}

}  // namespace dualdrive::motion
