// The states of a filter that are its sensors' own.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "dualdrive/innovations.hpp"

namespace dualdrive::innovations {

// What the sensors add to a sample, as the filter has it: their autoregressions, and their zeros where those drift.
class SensorStates {
  public:
    explicit SensorStates(const NoiseModel& noise)
        : noise_(noise),
          second_(noise.of_order_two()),
          drifts_(noise.drifts()),
          now_(noise.sensors.size(), 0.0),
          before_(now_),
          zero_(now_) {}
    // Of the filter's state.
    std::size_t size() const { return now_.size() * (second_ ? 2 : 1) + (drifts_ ? now_.size() : 0); }
    void forget() {
        for (auto* part : {&now_, &before_, &zero_}) std::fill(part->begin(), part->end(), 0.0);
    }
    double added(std::size_t channel) const { return now_[channel] + zero_[channel]; }
    // Corrected by K e, and on to the next sample.
    void flow(const double* moved) {
        const std::size_t m = now_.size();
        const double* const past = moved + m;
        const double* const drifted = second_ ? past + m : past;
        for (std::size_t j = 0; j < m; ++j) {
            const SensorNoise& sensor = noise_.sensors[j];
            now_[j] += moved[j];
            if (second_) before_[j] += past[j];
            const double next = sensor.memory * (1.0 - sensor.second) * now_[j] + sensor.second * before_[j];
            before_[j] = std::exchange(now_[j], next);
            if (drifts_) zero_[j] = sensor.drift.memory * (zero_[j] + drifted[j]);
        }
    }

  private:
    const NoiseModel& noise_;
    const bool second_, drifts_;
    std::vector<double> now_, before_, zero_;
};

}  // namespace dualdrive::innovations
