// The ticks of sampled loops along a flow.
#include <algorithm>
#include <cmath>
#include <limits>

#include "../simulation/instant.hpp"
#include "../simulation/mode_rules.hpp"
#include "dense.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

constexpr int most_parts = 64;           // of a sample, between ticks
constexpr std::size_t most_phases = 40;  // samples after which the ticks repeat
constexpr double alike = 1e-6;           // times, in samples

}  // namespace

// A stretch begins as the whole record left it there: its loops have ticked, at that instant, too.
void Flow::wind_clocks(double t) {
    const auto done = [&](double late, double period) {
        if (!(t > record_.begin())) return 0L;
        return std::max(0L, 1L + static_cast<long>(std::floor((t - record_.begin() - late + instant(t)) / period)));
    };
    ticks_.clear();
    put_out_.clear();
    for (const Clock& k : layout_.clocks) {
        ticks_.push_back(done(0.0, k.period));
        put_out_.push_back(std::min(ticks_.back(), done(k.latency, k.period)));
    }
}

double Flow::next_tick(double t) const {
    double next = std::numeric_limits<double>::infinity();
    const double begin = record_.begin();
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        next = std::min(next, begin + static_cast<double>(ticks_[c]) * k.period);
        if (k.latency > 0 && put_out_[c] < ticks_[c])
            next = std::min(next, begin + static_cast<double>(put_out_[c]) * k.period + k.latency);
    }
    return std::max(next, t);
}

void Flow::tick(double t) {
    const double begin = record_.begin(), now_or_past = t + instant(t);
    std::vector<double> next(static_cast<std::size_t>(states()));
    const auto jump = [&](const auto& apply) {
        evaluate(t, y_.data());
        std::copy_n(y_.data(), states(), next.data());
        apply();
        std::copy_n(next.data(), states(), y_.data());
    };
    bool any = false;
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        if (k.latency > 0 && put_out_[c] < ticks_[c] &&
            begin + static_cast<double>(put_out_[c]) * k.period + k.latency <= now_or_past) {
            jump([&] { model_.put_out(k, y_.data(), next.data()); });
            ++put_out_[c];
            any = true;
        }
    }
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        if (begin + static_cast<double>(ticks_[c]) * k.period <= now_or_past) {
            jump([&] { model_.tick(k, next.data()); });
            ++ticks_[c];
            any = true;
        }
    }
    if (any && now_) {
        all_guards(t, y_.data(), g0_.data());
        for (std::size_t k = 0; k < guard_count(); ++k)
            if (g0_[k] < 0 && layout_.switches[k / guards_per_switch].kind == SwitchKind::limiter) {
                evaluate(t, y_.data());
                const auto e = k / guards_per_switch;
                modes_[e] = standing_mode(layout_, model_, y_.data(), static_cast<int>(e), modes_[e]);
                now_ = &frozen();
            }
    }
}

// What a clock's outputs that wait, and then its tick, make of the state: linear, for their limits are left out.
std::vector<Eigen::MatrixXd> Flow::jumps() {
    std::vector<Eigen::MatrixXd> found;
    const std::vector<double> rest(static_cast<std::size_t>(n_), 0.0);
    const double t = record_.begin();
    std::vector<double> z(rest), next(rest);
    const auto column = [&](Eigen::Index k, const auto& apply) -> Eigen::VectorXd {
        z = rest;
        if (k >= 0) z[static_cast<std::size_t>(k)] = 1.0;
        evaluate(t, z.data());
        next = z;
        apply();
        return Eigen::Map<const Eigen::VectorXd>(next.data(), states());
    };
    const auto matrix = [&](const auto& apply) {
        const Eigen::VectorXd still = column(-1, apply);
        Eigen::MatrixXd J(states(), states());
        for (Eigen::Index k = 0; k < states(); ++k) J.col(k) = column(k, apply) - still;
        return J;
    };
    for (const Clock& k : layout_.clocks)
        found.push_back(k.latency > 0 ? matrix([&] { model_.put_out(k, z.data(), next.data()); })
                                      : Eigen::MatrixXd::Identity(states(), states()));
    for (const Clock& k : layout_.clocks) found.push_back(matrix([&] { model_.tick(k, next.data(), false); }));
    return found;
}

// Samples after which all clocks repeat; 0 where that takes too many.
std::size_t Flow::common_period() const {
    for (std::size_t samples = 1; samples <= most_phases; ++samples) {
        const bool all = std::all_of(layout_.clocks.begin(), layout_.clocks.end(), [&](const Clock& k) {
            const double ticks = static_cast<double>(samples) * record_.step() / k.period;
            return ticks > 0.5 && std::abs(ticks - std::round(ticks)) < alike * ticks;
        });
        if (all) return samples;
    }
    return 0;
}

std::size_t Flow::phase(std::size_t sample) const {
    if (phases_ == 1) return 0;
    double period = static_cast<double>(phases_) * record_.step();
    const double ticks = std::round(period / layout_.clocks.front().period);
    period = ticks * layout_.clocks.front().period;  // as the clocks have it: a record's own step may slip
    const double turns = (record_.times()[sample] - record_.begin()) / period;
    const auto nearest = static_cast<std::size_t>(std::lround((turns - std::floor(turns)) * double(phases_)));
    return nearest % phases_;
}

// What happens from a sample of a phase to the next one, both in samples after the first of them: (when, index into
// jumps_), in the order in which tick() does it.
std::vector<std::pair<double, std::size_t>> Flow::events(std::size_t phase) const {
    std::vector<std::pair<double, std::size_t>> found;
    const auto clocks = layout_.clocks.size();
    for (std::size_t c = 0; c < clocks; ++c) {
        const Clock& k = layout_.clocks[c];
        const auto turn = static_cast<double>(phases_);
        const double period = turn / std::round(turn * record_.step() / k.period);
        const auto add = [&](double late, std::size_t jump) {
            const double since = (static_cast<double>(phase) - late) / period;  // periods
            const double next = std::floor(since + alike) + 1.0;
            for (double j = next; (j - since) * period < 1.0 + alike; j += 1.0)
                found.emplace_back(std::min(1.0, (j - since) * period), jump);
        };
        if (k.latency > 0) add(k.latency / record_.step(), c);
        add(0.0, clocks + c);
    }
    std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
        return std::abs(a.first - b.first) > alike ? a.first < b.first : a.second < b.second;
    });
    return found;
}

Eigen::MatrixXd Flow::over_a_sample(const Frozen& frozen, std::size_t phase) {
    const double step = record_.step();
    if (layout_.clocks.empty()) return exponential(frozen.A, step);
    if (jumps_.empty()) jumps_ = jumps();
    if (spread_) return spread_over_a_sample(frozen);
    const Eigen::MatrixXd whole = exponential(frozen.A, step);
    Eigen::MatrixXd flow = Eigen::MatrixXd::Identity(n_, n_);
    double at = 0.0;
    const auto go_on = [&](double till) {
        if (till - at > 1.0 - alike)
            flow = product(whole, flow);
        else if (till - at > alike)
            flow = product(exponential(frozen.A, (till - at) * step), flow);
        at = till;
    };
    for (const auto& [when, jump] : events(phase)) {
        if (when - at > alike) go_on(when);
        flow.topRows(states()) = product(jumps_[jump], flow.topRows(states()));
    }
    go_on(1.0);
    return flow;
}

// Loops whose ticks do not repeat soon are spread over the samples from one tick to the next: the gains are those of a
// machine that does not change in time. The state itself flows with the ticks where they are.
Eigen::MatrixXd Flow::spread_over_a_sample(const Frozen& frozen) const {
    const double step = record_.step();
    double shortest = step;
    for (const Clock& k : layout_.clocks) shortest = std::min(shortest, k.period);
    const int parts = static_cast<int>(std::min(std::round(step / shortest), double(most_parts)));
    const double length = step / parts;
    Eigen::MatrixXd part = exponential(frozen.A, length);
    for (std::size_t k = 0; k < jumps_.size(); ++k) {
        const double share = std::min(1.0, length / layout_.clocks[k % layout_.clocks.size()].period);
        Eigen::MatrixXd jump = share * jumps_[k];
        jump.diagonal().array() += 1.0 - share;
        part.topRows(states()) = product(jump, part.topRows(states()));
    }
    Eigen::MatrixXd whole = part;
    for (int k = 1; k < parts; ++k) whole = product(part, whole);
    return whole;
}

}  // namespace dualdrive::innovations
