// The ticks of sampled loops along a flow.
#include <algorithm>
#include <cmath>
#include <limits>

#include "../simulation/instant.hpp"
#include "../simulation/mode_rules.hpp"
#include "../solvers/exact/kernels.hpp"
#include "dense.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

constexpr int most_parts = 64;           // of a sample, between ticks
constexpr std::size_t most_phases = 40;  // samples after which the ticks repeat
constexpr double alike = 1e-6;           // times, in samples
constexpr int worth = 12;                // ticks in a set of modes until its own are worked out

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

double Flow::ticks_a_sample() const {
    double sum = 0.0;
    for (const Clock& k : layout_.clocks) sum += record_.step() / k.period;
    return sum;
}

// The ticks of all clocks in these modes, where no limit is met.
void Flow::know_ticks(Frozen& frozen) {
    if (!frozen.ticks.empty()) return;
    const std::vector<double> rest(static_cast<std::size_t>(states()), 0.0);
    for (const Clock& k : layout_.clocks) {
        const Eigen::MatrixXd own = reader_.tick(frozen.modes, k, 0.0, rest.data());
        frozen.ticks.push_back(widened(own, own.rows()));
        frozen.ticking.push_back(packed_rows(frozen.ticks.back()));
    }
}

// Whether a tick was as the present modes' own is: no limit was met.
bool Flow::tick_by_map(std::size_t clock) {
    if (!now_ || !ticks_are_affine() || (now_->ticks.empty() && ++now_->ticked < worth)) return false;
    know_ticks(*now_);
    const auto rows = static_cast<std::size_t>(now_->ticks[clock].rows());
    ticked_.resize(static_cast<std::size_t>(exact::padded(static_cast<int>(rows))));
    exact::kernels().multiply(static_cast<int>(ticked_.size()), n_, now_->ticking[clock].data(), n_, y_.data(), 1,
                              ticked_.data());
    if (any_negative(ticked_.data() + states(), rows - static_cast<std::size_t>(states()))) return false;
    std::copy_n(ticked_.data(), states(), y_.data());
    return true;
}

void Flow::tick(double t) {
    const double begin = record_.begin(), now_or_past = t + instant(t);
    bool any = false;
    if (now_ && !now_->slaved.empty()) slave(t);
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        if (k.latency > 0 && put_out_[c] < ticks_[c] &&
            begin + static_cast<double>(put_out_[c]) * k.period + k.latency <= now_or_past) {
            model_.put_out(k, y_.data(), y_.data());
            ++put_out_[c];
            any = true;
        }
    }
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        if (!(begin + static_cast<double>(ticks_[c]) * k.period <= now_or_past)) continue;
        if (!tick_by_map(c)) {
            evaluate(t, y_.data());
            ticked_.assign(y_.begin(), y_.begin() + states());
            model_.tick(k, ticked_.data());
            if (heard_) note_limits(t, c);
            std::copy_n(ticked_.data(), states(), y_.data());
        }
        ++ticks_[c];
        any = true;
    }
    if (!any || !now_ || limiters_.empty()) return;
    if (ticks_are_affine())
        exact::kernels().multiply(static_cast<int>(g0_.size()), n_, now_->watched.data(), n_, y_.data(), 1, g0_.data());
    else
        all_guards(t, y_.data(), g0_.data());
    for (const int element : limiters_) {
        const auto e = static_cast<std::size_t>(element);
        const double* const g = g0_.data() + e * guards_per_switch;
        const bool fell = any_negative(g, guards_per_switch);
        if (!fell && !rides(element)) continue;
        evaluate(t, y_.data());
        if (rides(element)) {
            const int off = guard_off_limit(model_.block(layout_.switches[e].index), modes_[e]);
            if (!fell && off < 0) continue;
            modes_[e] = limiter_mode_after(t, element, off >= 0 ? off : g[0] < 0.0 ? 0 : 1);
        } else {
            modes_[e] = standing_mode(layout_, model_, y_.data(), element, modes_[e]);
        }
        now_ = &frozen();
        if (heard_) changes_.push_back({t, -1, modes_});
    }
}

// Of a tick that was just done by the model.
void Flow::note_limits(double t, std::size_t clock) {
    Change change{t, -1, modes_, static_cast<int>(clock)};
    for (std::size_t b = 0; b < layout_.blocks.size(); ++b) {
        const BlockPlace& place = layout_.blocks[b];
        if (place.loop != layout_.clocks[clock].loop) continue;
        const Block<double>& block = model_.block(static_cast<int>(b));
        if (std::abs(block.raw) <= block.limit) continue;
        const int row = place.pending >= 0 ? place.pending : place.held;
        change.limited.set.emplace_back(row, ticked_[static_cast<std::size_t>(row)]);
        if (place.integrator >= 0 && block.raw * block.integrand > 0.0) change.limited.kept.push_back(place.integrator);
    }
    if (!change.limited.set.empty()) changes_.push_back(std::move(change));
}

void Flow::tick_if_due(std::size_t sample, double t) {
    if (layout_.clocks.empty() || next_tick(t) > t + instant(t)) return;
    const double end = record_.times()[sample + 1];
    arriving_ = y_;
    ticked_at_ = t;
    if (t >= end - instant(end) && sample + 2 < record_.times().size()) {
        // a corner of the command lies at a sample: loops that tick there read the way on
        cell_ = {end, record_.times()[sample + 2]};
        std::copy_n(record_.generator_states(sample + 1), record_.generator().size(), y_.data() + states());
    }
    tick(t);
    at_end_ = false;
    if (scope_ == Scope::whole) rest_of_ = nullptr;
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

// The same where some of them wait.
std::vector<std::pair<double, std::size_t>> Flow::events(std::size_t phase, Waiting waiting) const {
    std::vector<std::pair<double, std::size_t>> found;
    const auto at_end = [](const auto& e) { return e.first > 1.0 - alike; };
    if (waiting.before)
        for (const auto& e : events((phase + phases_ - 1) % phases_))
            if (at_end(e)) found.emplace_back(0.0, e.second);
    for (const auto& e : events(phase))
        if (!at_end(e) || !waiting.after) found.push_back(e);
    return found;
}

bool Flow::waits(std::size_t sample) const {
    const double t = record_.times()[sample], index = std::round((t - record_.begin()) / record_.step());
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c)
        if (static_cast<double>(ticks_[c]) * layout_.clocks[c].period <= (index + alike) * record_.step()) return true;
    return false;
}

std::vector<Flow::Event> Flow::events_after(std::size_t sample) const {
    const double begin = record_.times()[sample] - record_.begin(), end = record_.times()[sample + 1] - record_.begin();
    const double now = begin + instant(record_.times()[sample]), then = end + instant(record_.times()[sample + 1]);
    std::vector<Event> found;
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        const auto add = [&](double late, std::size_t event) {
            for (double j = std::max(0.0, std::floor((now - late) / k.period) + 1.0); j * k.period + late <= then;
                 j += 1.0)
                found.push_back({record_.begin() + j * k.period + late, event});
        };
        if (k.latency > 0) add(k.latency, c);
        add(0.0, layout_.clocks.size() + c);
    }
    std::stable_sort(found.begin(), found.end(), [](const Event& a, const Event& b) {
        return std::abs(a.time - b.time) > instant(a.time) ? a.time < b.time : a.event < b.event;
    });
    return found;
}

Eigen::MatrixXd Flow::over_a_sample(Frozen& frozen, std::size_t phase, Waiting waiting) {
    const double step = record_.step();
    Eigen::MatrixXd flow, part;
    if (layout_.clocks.empty()) {
        flow = exponential(frozen.A, step);
        slave(frozen, flow);
        return flow;
    }
    know_ticks(frozen);
    if (spread_) return spread_over_a_sample(frozen);
    flow = Eigen::MatrixXd::Identity(n_, n_);
    double at = 0.0, length = 0.0;
    const auto go_on = [&](double till) {
        if (!(till - at > alike)) return;
        if (std::abs(till - at - length) > alike) part = exponential(frozen.A, (length = till - at) * step);
        flow = product(part, flow);
        at = till;
    };
    for (const auto& [when, event] : events(phase, waiting)) {
        go_on(when);
        jump(frozen, event, flow);
    }
    go_on(1.0);
    slave(frozen, flow);
    return flow;
}

Eigen::MatrixXd Flow::pushed_over_a_sample(Frozen& frozen, std::size_t phase, Waiting waiting) {
    know_ticks(frozen);
    Eigen::MatrixXd pushed = Eigen::MatrixXd::Zero(n_, states());
    double at = 0.0, length = 0.0;
    Exponentials part;
    const auto go_on = [&](double till) {
        if (!(till - at > alike)) return;
        if (std::abs(till - at - length) > alike) part = exponentials(frozen.A, (length = till - at) * record_.step());
        pushed = product(part.flow, pushed) + part.phi1.leftCols(states());
        at = till;
    };
    for (const auto& [when, event] : events(phase, waiting)) {
        go_on(when);
        jump(frozen, event, pushed);
    }
    go_on(1.0);
    slave(frozen, pushed);
    return pushed;
}

// Loops whose ticks do not repeat soon are spread over the samples from one tick to the next: the gains are those of a
// machine that does not change in time. The state itself flows with the ticks where they are.
Eigen::MatrixXd Flow::spread_over_a_sample(Frozen& frozen) {
    const double step = record_.step();
    double shortest = step;
    for (const Clock& k : layout_.clocks) shortest = std::min(shortest, k.period);
    const int parts = static_cast<int>(std::min(std::round(step / shortest), double(most_parts)));
    const double length = step / parts;
    const auto clocks = layout_.clocks.size();
    Eigen::MatrixXd part = exponential(frozen.A, length);
    for (std::size_t k = 0; k < 2 * clocks; ++k) {
        const double share = std::min(1.0, length / layout_.clocks[k % clocks].period);
        Eigen::MatrixXd jumped = part;
        jump(frozen, k, jumped);
        part += share * (jumped - part);
    }
    Eigen::MatrixXd whole = part;
    for (int k = 1; k < parts; ++k) whole = product(part, whole);
    slave(frozen, whole);
    return whole;
}

}  // namespace dualdrive::innovations
