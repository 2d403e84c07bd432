#include "dualdrive/summary.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace dualdrive {

namespace {

constexpr std::array<std::pair<std::string_view, Measure>, 7> measures{{{"min", Measure::minimum},
                                                                        {"max", Measure::maximum},
                                                                        {"range", Measure::range},
                                                                        {"peak", Measure::peak},
                                                                        {"mean", Measure::mean},
                                                                        {"rms", Measure::rms},
                                                                        {"final", Measure::final}}};

}  // namespace

Measure measure_of(std::string_view name) {
    std::string known;
    for (const auto& [text, measure] : measures) {
        if (text == name) return measure;
        known += (known.empty() ? "" : ", ") + std::string(text);
    }
    throw std::invalid_argument("measure = '" + std::string(name) + "' is unknown; choose one of " + known);
}

void Reducer::add(std::span<const double> t, const double* x, std::size_t stride) {
    const auto first = std::lower_bound(t.begin(), t.end(), reduction_.begin) - t.begin();
    const auto past = std::upper_bound(t.begin(), t.end(), reduction_.end) - t.begin();
    if (first >= past) return;
    const auto count = static_cast<std::size_t>(past - first);
    t = t.subspan(static_cast<std::size_t>(first), count);
    x += static_cast<std::size_t>(first) * stride;
    if (!any_) {
        any_ = true;
        t_first_ = t_last_ = t.front();
        low_ = high_ = last_ = *x;
    }
    switch (reduction_.measure) {
        case Measure::mean:
        case Measure::rms:
            integrate(t, x, stride);
            break;
        case Measure::final:
            break;
        default:
            widen(x, stride, count);
    }
    t_last_ = t.back();
    last_ = x[(count - 1) * stride];
}

void Reducer::widen(const double* x, std::size_t stride, std::size_t count) {
    double low = low_, high = high_;
    for (std::size_t k = 0; k < count; ++k) {
        low = std::min(low, x[k * stride]);
        high = std::max(high, x[k * stride]);
    }
    low_ = low;
    high_ = high;
}

void Reducer::integrate(std::span<const double> t, const double* x, std::size_t stride) {
    const bool square = squares();
    const auto weigh = [square](double v) { return square ? v * v : v; };
    double sum = integral_, before = t_last_, last = weigh(last_);
    for (std::size_t k = 0; k < t.size(); ++k) {
        const double now = weigh(x[k * stride]);
        sum += 0.5 * (last + now) * (t[k] - before);
        before = t[k];
        last = now;
    }
    integral_ = sum;
}

double Reducer::value() const {
    if (!any_) return std::numeric_limits<double>::quiet_NaN();
    const double length = t_last_ - t_first_;
    switch (reduction_.measure) {
        case Measure::minimum:
            return low_;
        case Measure::maximum:
            return high_;
        case Measure::range:
            return high_ - low_;
        case Measure::peak:
            return std::max(std::abs(low_), std::abs(high_));
        case Measure::mean:
            return length > 0 ? integral_ / length : last_;
        case Measure::rms:
            return length > 0 ? std::sqrt(integral_ / length) : std::abs(last_);
        case Measure::final:
            break;
    }
    return last_;
}

void FlankCount::add(Mode from, Mode to) {
    contacts += flank::carries(from) != flank::carries(to);
    for (const Mode mode : {from, to}) {
        if (!flank::carries(mode)) continue;
        reversals += mode == -side;
        side = mode;
    }
}

}  // namespace dualdrive
