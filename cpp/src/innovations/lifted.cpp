// Sampled loops: a sample with all their ticks as one step, while no mode changes and no limit is met.
//
// Between ticks the state flows by its propagator, a tick is affine: so is what both make of a sample, and of what laws add
// over it as a parabola. What must not fall on the way is a row of the same product.
#include <algorithm>
#include <cmath>

#include "../simulation/instant.hpp"
#include "../solvers/exact/kernels.hpp"
#include "dense.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

constexpr int worth = 12;       // samples of a phase until it gets its step
constexpr double alike = 1e-6;  // times, in samples
constexpr double same = 1e-9;   // lengths, in samples
constexpr int at_once = 16;     // rows that the kernels take together

}  // namespace

// n + a s + b s²/2 of the laws at a share s of the sample, from `at` on over `share` more of it: what the propagators of a part
// make of n, a and b.
Lifted Flow::lift(Frozen& frozen, std::size_t phase) {
    know_ticks(frozen);
    const auto d = static_cast<Eigen::Index>(driven_.size()), n = static_cast<Eigen::Index>(n_), wide = n + 3 * d;
    Eigen::MatrixXd y = Eigen::MatrixXd::Zero(n, wide);
    y.leftCols(n).setIdentity();
    double at = 0.0, length = 0.0;
    Exponentials part;
    const auto go_on = [&](double till) {
        const double share = till - at;
        if (!(share > alike)) return;
        if (std::abs(share - length) > alike) {
            length = share;
            if (affine_)
                part.flow = exponential(frozen.A, share * h_);
            else
                part = exponentials(frozen.A, share * h_);
        }
        y = product(part.flow, y);
        for (Eigen::Index k = 0; k < d; ++k) {
            const auto row = static_cast<Eigen::Index>(driven_[static_cast<std::size_t>(k)]);
            const auto p1 = part.phi1.col(row), p2 = part.phi2.col(row), p3 = part.phi3.col(row);
            y.col(n + k) += p1;
            y.col(n + d + k) += at * p1 + share * p2;
            y.col(n + 2 * d + k) += 0.5 * at * at * p1 + at * share * p2 + share * share * p3;
        }
        at = till;
    };
    Lifted own;
    own.due.resize(layout_.clocks.size());
    std::vector<Eigen::RowVectorXd> rows;
    const auto check = [&](const Eigen::RowVectorXd& row, int felt) {
        Eigen::RowVectorXd moving = row;
        moving(reader_.one()) = 0.0;
        if (felt < 0 && moving.isZero(0) && row(reader_.one()) >= 0.0) return;
        rows.push_back(row);
        own.checks.push_back({felt, at});
    };
    const auto check_guards = [&](bool limits) {
        const Eigen::MatrixXd g = product(frozen.guards, y);
        for (Eigen::Index k = 0; k < g.rows(); ++k) {
            const auto felt = std::find(watching_.begin(), watching_.end(), static_cast<int>(k));
            const bool limit =
                layout_.switches[static_cast<std::size_t>(k / guards_per_switch)].kind == SwitchKind::limiter;
            if (!limits || limit)
                check(g.row(k), felt == watching_.end() ? -1 : static_cast<int>(felt - watching_.begin()));
        }
    };
    const auto clocks = layout_.clocks.size();
    const auto coming = events(phase);
    for (std::size_t k = 0; k < coming.size(); ++k) {
        const auto [when, event] = coming[k];
        if (when > 1.0 - alike) break;
        if (when - at > alike) {
            go_on(when);
            check_guards(false);
        }
        Lifted::Due& due = own.due[event % clocks];
        if (event < clocks) {
            if (due.outputs++ == 0) due.output = when;
        } else {
            if (due.ticks++ == 0) due.tick = when;
            const Eigen::MatrixXd& tick = frozen.ticks[event - clocks];
            const Eigen::MatrixXd left = product(tick.bottomRows(tick.rows() - states()), y);
            for (Eigen::Index row = 0; row < left.rows(); ++row) check(left.row(row), -1);
        }
        jump(frozen, event, y);
        if (k + 1 == coming.size() || coming[k + 1].first - when > alike) check_guards(true);
    }
    go_on(1.0);
    if (affine_) check_guards(false);
    const auto seen = n + outputs_, height = seen + static_cast<Eigen::Index>(rows.size());
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero((height + at_once - 1) / at_once * at_once, wide);
    all.topRows(n) = y;
    all.middleRows(n, outputs_) = product(frozen.outputs, y);
    for (std::size_t k = 0; k < rows.size(); ++k) all.row(seen + static_cast<Eigen::Index>(k)) = rows[k];
    own.step.length = h_;
    own.step.flow.assign(all.data(), all.data() + all.size());
    const auto room = static_cast<std::size_t>(all.rows());
    if (out_.size() < room) out_.resize(room);
    if (trial_.size() < room) trial_.resize(room);
    return own;
}

const Lifted* Flow::lifted(Frozen& frozen, std::size_t phase) {
    frozen.lifted.resize(phases_);
    Lifted& own = frozen.lifted[phase];
    if (own.step.flow.empty()) {
        if (++own.step.asked < worth) return nullptr;
        own = lift(frozen, phase);
    }
    return &own;
}

// Whether the clocks stand as those of a step do: a record begins before anything waits, and its times may be off.
bool Flow::comes_as(const Lifted& own, double begin, double end) const {
    const double step = end - begin, near = alike * step;
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        const auto as_due = [&](long count, double late, long within, double when) {
            const double next = record_.begin() + static_cast<double>(count) * k.period + late;
            return within > 0 ? std::abs(next - begin - when * step) < near : next > end - instant(end);
        };
        const Lifted::Due& due = own.due[c];
        if (!as_due(ticks_[c], 0.0, due.ticks, due.tick)) return false;
        if (k.latency > 0 && !as_due(put_out_[c], k.latency, due.outputs, due.output)) return false;
    }
    return true;
}

// From a sample to the next one, its own ticks left to do; false where that takes more than one step.
bool Flow::leap(std::size_t sample) {
    if (layout_.clocks.empty() || memory_ || spread_ || substeps_ > 1 || finer_ > 0 || !ticks_are_affine())
        return false;
    const double begin = record_.times()[sample], end = record_.times()[sample + 1];
    if (std::abs(end - begin - h_) > same * h_) return false;
    if (!relaxing_.empty() && octaves() != octaves_) now_ = &frozen();
    if (!now_->rings.empty() || !now_->slaved.empty()) return false;
    const Lifted* const own = lifted(*now_, phase(sample));
    if (!own || !comes_as(*own, begin, end)) return false;
    if (affine_) {
        const auto rows = static_cast<int>(own->step.flow.size()) / n_;
        exact::kernels().multiply(rows, n_, own->step.flow.data(), n_, y_.data(), 1, out_.data());
        if (any_negative(out_.data() + n_ + outputs_, own->checks.size())) return false;
        std::copy_n(out_.data(), n_, y_.data());
        at_end_ = true;
    } else if (const Flown flown = fly(begin, own->step, own->checks); flown != Flown::done) {
        along_ = nullptr;
        if (flown == Flown::fallen) rest_of_ = nullptr;
        return false;
    }
    for (std::size_t c = 0; c < own->due.size(); ++c) {
        ticks_[c] += own->due[c].ticks;
        put_out_[c] += own->due[c].outputs;
    }
    return true;
}

}  // namespace dualdrive::innovations
