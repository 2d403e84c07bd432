#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "../solvers/exact/generator.hpp"
#include "dualdrive/innovations.hpp"

namespace dualdrive {

namespace {

// Of times that are about even, by least squares: each may be off by a little, and some may be missing.
double even_step(const std::vector<double>& times, std::vector<double> steps) {
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    const double median = *middle;
    std::vector<double> count{0.0};
    for (std::size_t k = 1; k < times.size(); ++k)
        count.push_back(count.back() + std::max(1.0, std::round((times[k] - times[k - 1]) / median)));
    const auto n = static_cast<double>(times.size());
    double along = 0.0, across = 0.0, mean_count = 0.0, mean_time = 0.0;
    for (std::size_t k = 0; k < times.size(); ++k) {
        mean_count += count[k] / n;
        mean_time += (times[k] - times[0]) / n;
    }
    for (std::size_t k = 0; k < times.size(); ++k) {
        along += (count[k] - mean_count) * (count[k] - mean_count);
        across += (count[k] - mean_count) * (times[k] - times[0] - mean_time);
    }
    return across / along;
}

}  // namespace

SampledRecord::SampledRecord(Inputs inputs, std::vector<double> times, std::vector<Channel> channels,
                             std::vector<double> measured)
    : inputs_(std::move(inputs)),
      generator_(std::make_shared<exact::Generator>(inputs_)),
      times_(std::move(times)),
      measured_(std::move(measured)),
      channels_(std::move(channels)) {
    if (times_.size() < 2) throw std::invalid_argument("record: fewer than two samples");
    if (measured_.size() != times_.size() * channels_.size())
        throw std::invalid_argument("record: " + std::to_string(measured_.size()) + " readings for " +
                                    std::to_string(times_.size()) + " times of " + std::to_string(channels_.size()) +
                                    " channels");
    std::vector<double> steps;
    for (std::size_t k = 1; k < times_.size(); ++k) {
        steps.push_back(times_[k] - times_[k - 1]);
        if (!(steps.back() > 0))
            throw std::invalid_argument("record: time does not increase at sample " + std::to_string(k));
    }
    step_ = even_step(times_, std::move(steps));
    // to nine digits: how far the times are from zero is in the last ones
    const double digit = std::pow(10.0, std::floor(std::log10(step_)) - 8.0);
    step_ = std::round(step_ / digit) * digit;
    begin_ = times_.front();
    const auto size = static_cast<std::size_t>(generator_->size());
    generator_states_.resize(times_.size() * size);
    for (std::size_t k = 0; k < times_.size(); ++k) {
        const double next = k + 1 < times_.size() ? times_[k + 1] : times_[k] + step_;
        generator_->set(times_[k], Cell{times_[k], next}, generator_states_.data() + k * size);
    }
}

SampledRecord SampledRecord::stretches(const std::vector<std::pair<std::size_t, std::size_t>>& which) const {
    if (which.empty()) throw std::invalid_argument("record: no stretches");
    SampledRecord found;
    found.inputs_ = inputs_;
    found.generator_ = generator_;
    found.channels_ = channels_;
    found.step_ = step_;
    found.begin_ = begin_;
    found.starts_.clear();
    const auto take = [&](const std::vector<double>& rows, std::size_t first, std::size_t count,
                          std::vector<double>& to) {
        const std::size_t width = rows.size() / times_.size();
        const auto from = rows.begin() + static_cast<std::ptrdiff_t>(first * width);
        to.insert(to.end(), from, from + static_cast<std::ptrdiff_t>(count * width));
    };
    for (const auto& [first, count] : which) {
        if (count < 2 || count > times_.size() || first > times_.size() - count)
            throw std::invalid_argument("record: no stretch of " + std::to_string(count) + " samples from sample " +
                                        std::to_string(first) + " on in " + std::to_string(times_.size()));
        found.starts_.push_back(found.times_.size());
        take(times_, first, count, found.times_);
        take(measured_, first, count, found.measured_);
        take(generator_states_, first, count, found.generator_states_);
    }
    return found;
}

const double* SampledRecord::generator_states(std::size_t sample) const {
    return generator_states_.data() + sample * static_cast<std::size_t>(generator_->size());
}

}  // namespace dualdrive
