// Sensitivities where modes change within a sample, or are too rare to have propagators: the way is gone piece by piece, by the
// series of ẏ = A y and δẋ = A δx + (A' − A)(y + δx), with a saltation at every change.
#include <algorithm>
#include <cmath>
#include <limits>

#include "../solvers/exact/kernels.hpp"
#include "sensitivity.hpp"

namespace dualdrive::innovations {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int most_terms = 60;        // of a series
constexpr double longest_part = 8.0;  // times the spectral radius
constexpr double most_parts = 1e3;    // of the way to a switch: a joint that is stiffer still is told by replays
constexpr double least_term = 1e-9;   // of a series, of what it begins with
constexpr double alike = 1e-6;        // times, in samples

}  // namespace

// The way to this sample in pieces, each with the tangent of its modes.
void Sensitivities::divide(std::size_t sample) {
    Moment& now = waiting_[count_ - 1];
    const double at_once = alike * record_.step();
    double begin = record_.times()[sample - 1];
    now.pieces.push_back({now.leaving});
    const auto next = [&](double time, Piece piece) {
        now.pieces.back().length = std::max(0.0, time - begin);
        begin = time;
        now.pieces.push_back(piece);
    };
    auto change = now.changes.begin();
    const auto up_to = [&](double time) {
        for (; change != now.changes.end() && change->time < time - at_once; ++change)
            if (change->limited_clock < 0)
                next(change->time, {.tangent = &tangent(change->modes), .guard = change->guard});
    };
    const auto clocks = static_cast<int>(now.leaving->ticking.size());
    if (clocks > 0)
        for (const auto& [time, event] : flow_->events_after(now.sample)) {
            up_to(time);
            Piece ticked{.tangent = now.pieces.back().tangent, .event = static_cast<int>(event)};
            for (const Flow::Change& own : now.changes)
                if (own.limited_clock >= 0 && own.limited_clock + clocks == ticked.event &&
                    std::abs(own.time - time) < at_once)
                    ticked.limited = &own.limited;
            next(time, ticked);
        }
    up_to(std::numeric_limits<double>::infinity());
    now.pieces.back().length = std::max(0.0, record_.times()[sample] - begin);
}

// What a tick makes of y and of all columns: of what it sets to a limit nothing is left, and what it keeps stays.
void Sensitivities::tick(const Tangent& tangent, const Piece& piece) {
    const std::size_t all = columns_.size(), rows = static_cast<std::size_t>(exact::padded(n_));
    Eigen::Map<MatrixXd> way(way_.data(), static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(all + 1));
    const VectorXd y = way.col(static_cast<Eigen::Index>(all)).head(n_);
    const MatrixXd before = way.topRows(n_);
    auto present = way.topRows(n_);
    const auto event = static_cast<std::size_t>(piece.event);
    flow_->jump(tangent.known, event, present);
    const std::size_t clocks = tangent.ticking.size();
    for (std::size_t c = 0; event >= clocks && c < all - laws_; ++c)
        for (const Entry& e : tangent.ticking[event - clocks][c]) {
            const auto column = static_cast<Eigen::Index>(c);
            way(static_cast<Eigen::Index>(e.row), column) +=
                e.value *
                (y(static_cast<Eigen::Index>(e.column)) + before(static_cast<Eigen::Index>(e.column), column));
        }
    if (!piece.limited) return;
    for (const int k : piece.limited->kept) way.row(k) = before.row(k);
    for (const auto& [k, limit] : piece.limited->set) {
        way.row(k).setZero();
        way(k, static_cast<Eigen::Index>(all)) = limit;
    }
}

// By the tangent of the sample's beginning alone, flanks that part and meet had been a sample late, and slopes by their gap half
// wrong.
void Sensitivities::through_changes(const Moment& now, std::size_t at) {
    const std::size_t all = columns_.size(), rows = static_cast<std::size_t>(exact::padded(n_)),
                      states = static_cast<std::size_t>(states_),
                      torque = static_cast<std::size_t>(flow_->first_disturbance());
    std::fill(way_.begin(), way_.end(), 0.0);
    for (std::size_t c = 0; c < all; ++c) {
        const double* const x = column(x_, c);
        std::copy_n(x, states, way_.data() + c * rows);
        std::copy_n(x + states, disturbances_, way_.data() + c * rows + torque);
    }
    double* const y = way_.data() + all * rows;
    std::copy_n(y_.data() + at * static_cast<std::size_t>(n_), n_, y);
    for (const Piece& piece : now.pieces) {
        if (&piece != &now.pieces.front() && !(&piece - 1)->tangent->known.slaved.empty())
            slave(*(&piece - 1)->tangent);
        if (piece.guard >= 0) change(*(&piece - 1)->tangent, piece, now.sample);
        if (piece.event >= 0) tick(*piece.tangent, piece);
        const double end =
            static_cast<double>(&piece == &now.pieces.back()) - static_cast<double>(&piece == &now.pieces.front());
        const double asked = 1.0 + std::floor(piece.tangent->bound * piece.length / longest_part);
        lost_ = lost_ || asked > most_parts;
        if (lost_) return;
        const int parts = static_cast<int>(asked);
        for (int part = 0; part < parts; ++part) spent_ += expand(*piece.tangent, piece.length / parts, at, end);
    }
    const Tangent& last = *now.pieces.back().tangent;
    const auto m = static_cast<Eigen::Index>(channels_);
    const Eigen::Map<const VectorXd> arrived(y, n_);
    for (std::size_t c = 0; c < all; ++c) {
        double* const next = column(next_, c);
        std::copy_n(way_.data() + c * rows, states, next);
        Eigen::Map<VectorXd> shown(next + size_, m);
        shown = last.outputs * Eigen::Map<const VectorXd>(way_.data() + c * rows, n_) + last.showing[c] * arrived;
        shown += Eigen::Map<const VectorXd>(next + states_ + disturbances_, m);
        if (gains_.noise.drifts()) shown += Eigen::Map<const VectorXd>(next + size_ - m, m);
    }
}

// What rates jump by (those of a damped mesh do) acts for longer, or less long, in a neighbour whose guard g falls earlier or
// later: δx⁺ = δx⁻ + (f⁺ − f⁻) δg / ġ, the saltation of Aizerman and Gantmacher (Leine, Nijmeijer, Dynamics and Bifurcations of
// Non-Smooth Mechanical Systems, 2004, ch. 7).
void Sensitivities::change(const Tangent& before, const Piece& piece, std::size_t sample) {
    const std::size_t all = columns_.size(), first = all - laws_, rows = static_cast<std::size_t>(exact::padded(n_));
    const Eigen::Map<const VectorXd> y(way_.data() + all * rows, n_);
    const auto rate = [&](const Tangent& of) -> VectorXd {
        return Eigen::Map<const MatrixXd>(of.rates.data(), static_cast<Eigen::Index>(rows), n_).topRows(n_) * y;
    };
    const VectorXd f = rate(before), jump = rate(*piece.tangent) - f;
    const Eigen::RowVectorXd g = before.guards.row(piece.guard);
    // where a ride ends nothing jumps, the rate of its integrator neither
    const bool ride = limiter::riding(before.modes[static_cast<std::size_t>(piece.guard / guards_per_switch)]);
    const double falls = g * f, own = laws_ ? flow_->guard(sample, before.modes, y.data(), piece.guard) : 0.0;
    ++changes_;
    for (std::size_t c = 0; c < all; ++c) {
        Eigen::Map<VectorXd> x(way_.data() + c * rows, n_);
        const double otherwise = c < first ? before.guarding[c].row(piece.guard) * y
                                           : columns_[c].flow->guard(sample, before.modes, y.data(), piece.guard) - own;
        if (falls < 0.0) {
            const double later = -(g * x + otherwise) / falls;
            if (!ride) x.head(states_) -= jump.head(states_) * later;
            apart_[c] += std::abs(later) > record_.step();
        }
        for (const std::size_t k : piece.tangent->held) x[static_cast<Eigen::Index>(k)] = 0.0;
    }
}

// A riding limiter's integrator follows from the other states, in a neighbour as in the machine: at the end of a piece, of all
// columns and of y behind them; and where a sample is corrected.
void Sensitivities::slave(const Tangent& tangent) {
    const std::size_t all = columns_.size();
    Eigen::Map<MatrixXd> way(way_.data(), exact::padded(n_), static_cast<Eigen::Index>(all + 1));
    auto y = way.col(static_cast<Eigen::Index>(all)).head(n_);
    const auto& slaved = tangent.known.slaved;
    for (std::size_t k = 0; k < slaved.size(); ++k) {
        const auto& [state, row] = slaved[k];
        for (std::size_t c = 0; c < all; ++c) {
            auto x = way.col(static_cast<Eigen::Index>(c)).head(n_);
            x(state) = row.dot(x) + tangent.slaving[c].row(static_cast<Eigen::Index>(k)).dot(y);
        }
        y(state) = row.dot(y);
    }
}

void Sensitivities::slave(const Tangent& tangent, std::size_t at) {
    const Eigen::Map<const VectorXd> y(y_.data() + at * static_cast<std::size_t>(n_), n_);
    const auto& slaved = tangent.known.slaved;
    for (std::size_t k = 0; k < slaved.size(); ++k)
        for (std::size_t c = 0; c < columns_.size(); ++c) {
            const auto& [state, row] = slaved[k];
            double* const x = column(x_, c);
            x[state] = row.head(states_).dot(Eigen::Map<const VectorXd>(x, states_)) +
                       tangent.slaving[c].row(static_cast<Eigen::Index>(k)).dot(y);
        }
}

// What laws do to the control of a neighbour while a limiter rides is none of their rates: its integrator follows from it.
bool Sensitivities::rode() const {
    return std::any_of(tangents_.begin(), tangents_.end(),
                       [](const auto& known) { return !known.second.known.slaved.empty(); });
}

// All columns, and y behind them, on by a piece of a sample. end: −1 at the sample's beginning, 1 at its end, where laws are
// felt. Returns how many terms that took.
int Sensitivities::expand(const Tangent& tangent, double length, std::size_t at, double end) {
    const std::size_t all = columns_.size(), first = all - laws_, rows = static_cast<std::size_t>(exact::padded(n_)),
                      states = static_cast<std::size_t>(states_);
    const double reach = tangent.bound * length;
    double size = 1.0;
    int k = 1;
    last_ = way_;
    for (; k < most_terms && (size > least_term || k < reach); ++k) {
        exact::kernels().product(static_cast<int>(rows), n_, tangent.rates.data(), static_cast<int>(rows), last_.data(),
                                 static_cast<int>(all + 1), term_.data());
        const double* const y = last_.data() + all * rows;
        for (std::size_t c = 0; c < first; ++c)
            for (const Entry& e : tangent.differs[c])
                term_[c * rows + e.row] += e.value * (y[e.column] + last_[c * rows + e.column]);
        for (std::size_t c = first; k == 1 && c < all; ++c) {
            const std::size_t law = ((c - first) * many + at) * states;
            for (std::size_t r = 0; r < states; ++r) term_[c * rows + r] += rates_[law + r] + end * more_[law + r];
        }
        for (std::size_t j = 0; j < term_.size(); ++j) {
            term_[j] *= length / k;
            way_[j] += term_[j];
        }
        std::swap(term_, last_);
        size *= reach / k;
    }
    return k;
}

}  // namespace dualdrive::innovations
