// A signal of the past: values at the starts of steps; cubics through four of them, or straight lines where it jumps.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace blind {

class Delay {
  public:
    Delay(double time, double step, double first, bool jumps = false)
        : steps_(time / step), jumps_(jumps), ring_(static_cast<std::size_t>(std::ceil(steps_)) + 4, first) {
        if (time > 0 && steps_ < 1) steps_ = 1;  // a shorter delay than a step can't be told from one step
    }

    bool on() const { return steps_ > 0; }

    // Value at the start of a step.
    void push(double value) {
        if (!on()) return;
        head_ = head_ + 1 < ring_.size() ? head_ + 1 : 0;
        ring_[head_] = value;
    }

    // The delayed signal `part` (0 .. 1) of a step after the last push.
    double at(double part) const {
        double back = steps_ - part;
        auto whole = static_cast<std::size_t>(back);
        double rest = back - static_cast<double>(whole);
        double here = past(whole), before = past(whole + 1);
        if (jumps_ || whole == 0) return (1 - rest) * here + rest * before;
        double after = past(whole - 1), long_before = past(whole + 2), u = rest, v = 1 - rest;
        return here * v * (1 + u) * (1 + v) / 2 + before * u * (1 + u) * (1 + v) / 2 - after * u * v * (1 + v) / 6 -
               long_before * u * v * (1 + u) / 6;
    }

  private:
    double past(std::size_t n) const { return ring_[(head_ + ring_.size() - n % ring_.size()) % ring_.size()]; }

    double steps_;
    bool jumps_;
    std::vector<double> ring_;
    std::size_t head_ = 0;
};

}  // namespace blind
