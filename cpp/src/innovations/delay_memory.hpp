#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <vector>

#include "dualdrive/layout.hpp"
#include "dualdrive/model.hpp"

namespace dualdrive::innovations {

// Past values of the delayed signals, one a substep, with straight lines between them.
class DelayMemory final : public Past<double> {
  public:
    DelayMemory(const Layout& layout, const Machine& machine, double step) : layout_(layout), step_(step) {
        double longest = 0.0;
        for (const auto& d : layout.delays) longest = std::max(longest, machine.values()[d.slot]);
        keep_ = static_cast<std::size_t>(longest / step) + 4;
        lines_.resize(layout.delays.size());
    }
    void append(double t, const Model<double>& model) {
        if (!times_.empty() && t <= times_.back()) {  // the present sample, corrected
            times_.pop_back();
            for (auto& line : lines_) line.pop_back();
        }
        times_.push_back(t);
        for (std::size_t d = 0; d < lines_.size(); ++d)
            lines_[d].push_back(model.signals()[static_cast<std::size_t>(layout_.delays[d].source)]);
        for (; times_.size() > keep_; times_.pop_front())
            for (auto& line : lines_) line.pop_front();
    }
    double at(int line, const double& t, const Cell&) const override {
        const auto& values = lines_[static_cast<std::size_t>(line)];
        if (times_.empty()) return 0.0;
        if (t <= times_.front() || times_.size() == 1) return t <= times_.front() ? values.front() : values.back();
        auto after = std::lower_bound(times_.begin(), times_.end(), t);
        if (after == times_.end()) --after;  // less than a step late: on along the last line
        if (after == times_.begin()) ++after;
        const auto k = static_cast<std::size_t>(after - times_.begin());
        const double x = (t - times_[k - 1]) / (times_[k] - times_[k - 1]);
        return values[k - 1] + x * (values[k] - values[k - 1]);
    }

  private:
    const Layout& layout_;
    double step_;
    std::size_t keep_;
    std::deque<double> times_;
    std::vector<std::deque<double>> lines_;
};

}  // namespace dualdrive::innovations
