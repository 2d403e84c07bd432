// A learned curve as an effect on a body: a torque over one coordinate or two, linear in the values at its knots.
//
// Between the knots of an axis, which are evenly spaced, the curve is a cubic with the knots' values and, as slopes there,
// central differences of them (Catmull-Rom); at both ends of an axis that is not periodic the slope is zero and the curve
// goes on as a constant, so that it is smooth to the first derivative everywhere. On two axes it is the tensor product.
#pragma once

#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "source.hpp"

namespace dualdrive {

// The knots that have a say at one value of a coordinate, and how much; the shares sum up to 1.
template <class S>
struct KnotShares {
    std::array<std::size_t, 4> knot;
    std::array<S, 4> share;
    std::size_t first = 0, last = 4;

    KnotShares(const CurveAxis& axis, const S& x) {
        const auto n = static_cast<std::ptrdiff_t>(axis.knots);
        const double step = (axis.high - axis.low) / static_cast<double>(axis.periodic ? n : n - 1);
        const S u = (x - axis.low) * (1.0 / step);
        const double cell = std::floor(value_of(u));
        if (!axis.periodic && !(cell >= 0.0 && cell < static_cast<double>(n - 1))) {
            last = 1;
            knot[0] = static_cast<std::size_t>(value_of(u) > 0.0 ? n - 1 : 0);
            share[0] = S(1.0);
            return;
        }
        const auto wrapped =
            static_cast<std::ptrdiff_t>(cell - std::floor(cell / static_cast<double>(n)) * static_cast<double>(n));
        const S s = u - cell, rest = 1.0 - s;
        const S start = s * rest * rest * 0.5, end = s * s * rest * -0.5;  // Hermite's slopes, halved: of differences
        const S rise = s * s * (3.0 - 2.0 * s);
        const bool at_start = !axis.periodic && wrapped == 0, at_end = !axis.periodic && wrapped == n - 2;
        for (std::ptrdiff_t k = 0; k < 4; ++k)
            knot[static_cast<std::size_t>(k)] = static_cast<std::size_t>((wrapped + k - 1 + n) % n);
        share = {-start, 1.0 - rise - end, rise + start, end};
        if (at_start) {
            first = 1;
            share[2] -= start;
        }
        if (at_end) {
            last = 3;
            share[1] += end;
        }
    }
};

template <class S>
class CurveEffect final : public Effect<S> {
  public:
    CurveEffect(const EffectEntry& entry, const Layout& layout, const S* values)
        : axes_(entry.axes), values_(values, values + entry.count) {
        for (const auto& axis : axes_) {
            const auto source = find_source(axis.coordinate, layout);
            if (!source)
                throw std::invalid_argument(
                    "effect " + entry.label + ": its coordinate '" + axis.coordinate +
                    "' is neither a signal known before body torques, a recorded column, t, angle, "
                    "nor speed");
            sources_.push_back(*source);
        }
    }

    S torque_on_body(const BodyPort<S>& at) const override {
        const KnotShares<S> rows(axes_[0], sources_[0].read(at));
        if (axes_.size() == 1) return along(rows, values_.data());
        const KnotShares<S> columns(axes_[1], sources_[1].read(at));
        const auto width = static_cast<std::size_t>(axes_[1].knots);
        S sum(0.0);
        for (std::size_t k = rows.first; k < rows.last; ++k)
            sum += rows.share[k] * along(columns, values_.data() + rows.knot[k] * width);
        return sum;
    }

  private:
    static S along(const KnotShares<S>& shares, const S* values) {
        S sum(0.0);
        for (std::size_t k = shares.first; k < shares.last; ++k) sum += shares.share[k] * values[shares.knot[k]];
        return sum;
    }

    const std::vector<CurveAxis>& axes_;  // of the machine's entry, which outlives the model
    std::vector<Source> sources_;
    std::vector<S> values_;
};

}  // namespace dualdrive
