#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <vector>

#include "dualdrive/layout.hpp"
#include "dualdrive/model.hpp"

namespace dualdrive::innovations {

// Past values of the delayed signals, one a substep, with straight lines between them. At a sample they jump, where the state
// is corrected: a signal came to one value and went on from another.
class DelayMemory final : public Past<double>, public Past<Gradient> {
  public:
    DelayMemory(const Layout& layout, const Machine& machine, double step) : layout_(layout), step_(step) {
        for (const auto& d : layout.delays) longest_ = std::max(longest_, machine.values()[d.slot]);
        lines_.resize(layout.delays.size());
    }
    // As the model was evaluated last: what signals came to at t; and from what they go on there.
    void arrive(double t, const Model<double>& model) {
        times_.push_back(t);
        for (std::size_t d = 0; d < lines_.size(); ++d) lines_[d].push_back({signal(d, model), signal(d, model)});
        for (; times_.size() > 2 && times_[1] < t - longest_ - step_; times_.pop_front())
            for (auto& line : lines_) line.pop_front();
    }
    void go_on(double t, const Model<double>& model) {
        if (times_.empty() || t > times_.back() + alike * step_) return arrive(t, model);
        for (std::size_t d = 0; d < lines_.size(); ++d) lines_[d].back().left = signal(d, model);
    }
    double at(int line, const double& t, const Cell& cell) const override { return read(line, t, cell); }
    Gradient at(int line, const Gradient& t, const Cell& cell) const override { return read(line, t, cell); }

  private:
    // At the end of the cell what it came to, at its beginning from what it went on.
    template <class S>
    S read(int line, const S& t, const Cell& cell) const {
        const auto& values = lines_[static_cast<std::size_t>(line)];
        const double now = value_of(t);
        if (times_.empty()) return S(0.0);
        if (now <= times_.front() || times_.size() == 1)
            return S(now <= times_.front() ? values.front().left : values.back().left);
        auto after = now > 0.5 * (cell.low + cell.high)
                         ? std::lower_bound(times_.begin(), times_.end(), now - alike * step_)
                         : std::upper_bound(times_.begin(), times_.end(), now + alike * step_);
        if (after == times_.end()) --after;  // less than a step late: on along the last line
        if (after == times_.begin()) ++after;
        const auto k = static_cast<std::size_t>(after - times_.begin());
        const S x = (t - times_[k - 1]) / (times_[k] - times_[k - 1]);
        return values[k - 1].left + x * (values[k].come - values[k - 1].left);
    }

    static constexpr double alike = 1e-6;  // of a step: the same time
    struct Value {
        double come, left;
    };
    double signal(std::size_t line, const Model<double>& model) const {
        return model.signals()[static_cast<std::size_t>(layout_.delays[line].source)];
    }
    const Layout& layout_;
    double step_, longest_ = 0.0;  // s
    std::deque<double> times_;
    std::vector<std::deque<Value>> lines_;
};

}  // namespace dualdrive::innovations
