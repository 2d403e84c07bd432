// The ticks of sampled loops along a flow.
#include <algorithm>
#include <cmath>
#include <limits>

#include "../simulation/instant.hpp"
#include "../simulation/mode_rules.hpp"
#include "flow.hpp"
#include "riccati.hpp"

namespace dualdrive::innovations {

namespace {

constexpr int most_parts = 64;  // of a sample, between ticks

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
        for (std::size_t k = 0; k < g0_.size(); ++k)
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

// A loop that ticks less often than the record is read is spread over the samples from one tick to the next: the gains are
// those of a machine that does not change in time. The state itself flows with the ticks where they are.
Eigen::MatrixXd Flow::over_a_sample(const Frozen& frozen) {
    const double step = record_.step();
    if (layout_.clocks.empty()) return exponentials(frozen.A, step).flow;
    if (jumps_.empty()) jumps_ = jumps();
    double shortest = step;
    for (const Clock& k : layout_.clocks) shortest = std::min(shortest, k.period);
    const int parts = static_cast<int>(std::min(std::round(step / shortest), double(most_parts)));
    const double length = step / parts;
    Eigen::MatrixXd part = exponentials(frozen.A, length).flow;
    for (std::size_t k = 0; k < jumps_.size(); ++k) {
        const double share = std::min(1.0, length / layout_.clocks[k % layout_.clocks.size()].period);
        Eigen::MatrixXd jump = share * jumps_[k];
        jump.diagonal().array() += 1.0 - share;
        part.topRows(states()) = (jump * part.topRows(states())).eval();
    }
    Eigen::MatrixXd whole = part;
    for (int k = 1; k < parts; ++k) whole = (part * whole).eval();
    return whole;
}

}  // namespace dualdrive::innovations
