// How signals of a machine become readings of a record.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "dualdrive/effects.hpp"
#include "dualdrive/innovations.hpp"
#include "dualdrive/recorder.hpp"

namespace dualdrive::innovations {

// What becomes of a signal on its way into the record; the delay's whole samples shift the record, the rest goes along the
// signal's own slope and curvature (`Flow::outputs`), so that a residual is smooth in it.
class Reading {
  public:
    Reading(const Machine& machine, const SampledRecord& record, std::size_t channel)
        : effects_(reading_effects(machine, record.channels()[channel].places)),
          measures_(record.channels()[channel].name.starts_with("theta_") ? Measures::angle : Measures::other) {
        double late = 0.0;
        for (const auto& effect : effects_) late += effect->delay();
        shift_ = static_cast<std::size_t>(std::max(0.0, std::round(late / record.step())));
        rest_ = late - static_cast<double>(shift_) * record.step();
    }
    bool plain() const { return effects_.empty(); }
    std::size_t shift() const { return shift_; }
    // How much earlier than the state it is, s: less than a sample.
    double rest() const { return rest_; }
    // Of a signal at the time of a state; the reading `shift` samples later.
    double read(double t, double signal) const {
        for (const auto& effect : effects_) signal = effect->reading(signal, {t, measures_});
        return signal;
    }

  private:
    std::vector<std::unique_ptr<Effect<double>>> effects_;
    Measures measures_;
    std::size_t shift_ = 0;
    double rest_ = 0.0;
};

inline std::vector<Reading> readings_of(const Machine& machine, const SampledRecord& record) {
    std::vector<Reading> readings;
    for (std::size_t j = 0; j < record.channels().size(); ++j) readings.emplace_back(machine, record, j);
    return readings;
}

}  // namespace dualdrive::innovations
