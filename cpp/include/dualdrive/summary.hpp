// Numbers that sum up a run: extremes, means and final values of signals over a time window, and what flanks did.
//
// Signals come row by row as a run records them, in blocks of any size, and none is kept: a long run sums up in the
// memory of a short one, and to the same bits however it was cut.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dualdrive/switching.hpp"

namespace dualdrive {

// range: maximum less minimum; peak: largest |x|. Means are over time, by the trapezoidal rule, so that uneven output
// times weigh what they should.
enum class Measure { minimum, maximum, range, peak, mean, rms, final };
Measure measure_of(std::string_view name);  // std::invalid_argument naming those there are

struct Reduction {
    std::string signal;
    Measure measure;
    double begin = -std::numeric_limits<double>::infinity();  // s; output times from begin to end count, both included
    double end = std::numeric_limits<double>::infinity();
};

// One reduction on its way through a run.
class Reducer {
  public:
    Reducer(const Reduction& reduction) : reduction_(reduction) {}

    // Rows in order of time; x[k·stride] is the signal at t[k].
    void add(std::span<const double> t, const double* x, std::size_t stride);
    // NaN where no output time lies in the window.
    double value() const;

  private:
    void widen(const double* x, std::size_t stride, std::size_t count);
    void integrate(std::span<const double> t, const double* x, std::size_t stride);
    bool squares() const { return reduction_.measure == Measure::rms; }

    Reduction reduction_;
    bool any_ = false;
    double low_ = 0.0, high_ = 0.0, integral_ = 0.0, t_first_ = 0.0, t_last_ = 0.0, last_ = 0.0;
};

// What the flanks of one connection did.
struct FlankCount {
    long contacts = 0;       // flanks that began or ceased to carry
    long reversals = 0;      // from one carrying flank to the other, through the gap or (gap 0) at once
    Mode side = flank::gap;  // the last that carried

    void add(Mode from, Mode to);
};

}  // namespace dualdrive
