// A step that was taken, in pieces: the walk over it, where its guards need a close look, and its states in between.
#include <algorithm>
#include <cmath>

#include "../../simulation/instant.hpp"
#include "exponential.hpp"
#include "terms.hpp"

namespace dualdrive {

using exponential::expand, exponential::inverse_factorial, exponential::rescale, exponential::shift, exponential::terms;

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr int coarser = 6;         // doublings of the finest step: a stretch of the walk, unless it is doubted
constexpr std::size_t chunk = 16;  // stretches that are looked at together
constexpr double straight = 0.01;  // of what a guard keeps off zero: a bend of less is a doubt, no more

}  // namespace

// ------------------------------------------------------------------------------------------- the step in pieces

// Up to the next suspect, or over it.
Solver::Outcome Exponential::deliver(double stop) {
    const std::size_t last = std::min(stretches(), points_);  // the end may lie a rounding beyond the last node
    if (position_ >= looked_ && position_ < last) look_on();
    keeps_off_ = suspects_.empty() || suspects_.back() != position_;
    if (!keeps_off_) {
        suspects_.pop_back();
        ++position_;
    } else {
        position_ = std::min(last, suspects_.empty() ? looked_ : suspects_.back());
    }
    const double t = position_ >= last ? end_ : origin_ + static_cast<double>(position_) * stride();
    const double* y = at(t);
    quadrature_at(t, work_.data());
    std::copy_n(y, states_, z_.begin());
    t_ = t;
    write_end();
    return t == stop ? Outcome::stopped : Outcome::stepped;
}

// Of the walk, to the end of the step. One that is no longer than times are told apart by is none: a break at the end would be
// passed before it.
std::size_t Exponential::stretches() const {
    const double count = std::ceil((end_ - origin_ - instant(end_)) / stride());
    return static_cast<std::size_t>(std::max(count, 1.0));
}

// y and c on points as near to each other as the walk needs them, up to the end of the step at least.
void Exponential::walk() {
    walk_level_ = std::min({level_, 0, propagators().finest() + coarser}) - finer_;
    const std::size_t m = driven_.size(), per_node = std::size_t{1} << (level_ - walk_level_),
                      all = intervals * per_node;
    points_ = std::min(all, (stretches() + 1) / 2 * 2);
    position_ = 0;
    looks_ += static_cast<long>((points_ + chunk - 1) / chunk);
    walked_.resize((points_ + 1) * width());
    for (std::size_t k = 0; k <= points_; ++k) {
        if (k % per_node == 0) {
            std::copy_n(column(k / per_node), width(), point(k));
            rescale(point(k) + rows(), m, 1.0 / static_cast<double>(per_node));
            continue;
        }
        pass(point(k - 1), walk_level_, origin_ + static_cast<double>(k - 1) * stride(), point(k));
        std::copy_n(point(k - 1) + rows(), terms * m, point(k) + rows());
        shift(point(k) + rows(), m);
    }
}

// What laws make of the watched quantities besides their linear part: all of it where that counts, else how much it is.
void Exponential::find_bends() {
    exponential::Watch& watch = now_->watch;
    for (std::size_t j = 0; j < nodes; ++j) watch.set_apart(guards_.data() + j * guard_count_);
    const auto tall = static_cast<std::size_t>(watch.rows()), count = watch.quantities().size();
    bends_.assign(nodes * tall, 0.0);
    doubt_.assign(2 * tall, 0.0);  // of the chunk, of the whole step
    std::vector<double> linear(nodes * tall), nearest(tall, infinite);
    exact::kernels().multiply(watch.rows(), static_cast<int>(rows()), watch.values().data(), propagators().width(),
                              column(0), static_cast<int>(nodes), linear.data());
    for (std::size_t j = 0; j < nodes; ++j)
        for (std::size_t i = 0; i < count; ++i) {
            const auto& q = watch.quantities()[i];
            const double value = guards_[j * guard_count_ + static_cast<std::size_t>(q.low)],
                         bend = value - linear[j * tall + i];
            bends_[j * tall + i] = bend;
            nearest[i] = std::min({nearest[i], value, q.upper - value});
            doubt_[tall + i] = std::max(doubt_[tall + i], 2.0 * std::abs(bend));
        }
    bent_.clear();
    for (std::size_t i = 0; i < count; ++i)
        if (!(doubt_[tall + i] <= straight * nearest[i])) {
            bent_.push_back(i);
            doubt_[tall + i] = 0.0;
        }
    if (!bent_.empty()) expand(bends_, watch.rows(), bend_terms_);
}

void Exponential::look_for_suspects() {
    suspects_.clear();
    looked_ = points_;
    if (guard_count_ == 0) return;
    find_bends();
    looked_ = 0;
    look_on();
    if (4 * suspects_.size() > points_ && walk_level_ > propagators().finest())
        ++finer_;
    else if (suspects_.empty() && finer_ > 0)
        --finer_;
}

// The stretches of the walk over which the quintic through both ends does not keep off zero by what it is doubted by, as
// far as the first fall. What comes after it is no solution, unless the run takes it for rounding: then the look goes on.
void Exponential::look_on() {
    exponential::Watch& watch = now_->watch;
    const std::vector<double>& W = watch.matrix(walk_level_);
    const int tall = watch.rows();
    const auto m = static_cast<std::size_t>(tall), per_node = std::size_t{1} << (level_ - walk_level_);
    std::vector<double> margin(m);
    watched_.resize(3 * m * (chunk + 1));
    const std::size_t begin = looked_;
    for (std::size_t first = begin / 2 * 2; first < points_; first += chunk) {
        const std::size_t count = std::min(chunk, points_ - first);
        exact::kernels().multiply(3 * tall, static_cast<int>(rows() + 2 * driven_.size()), W.data(),
                                  propagators().width(), point(first), static_cast<int>(count) + 1, watched_.data());
        for (std::size_t k = 0; k <= count && !bent_.empty(); ++k) {
            const std::size_t node = std::min((first + k) / per_node, intervals);
            const double x = static_cast<double>(first + k - node * per_node) / static_cast<double>(per_node);
            for (const std::size_t i : bent_) {
                const double* const c = bend_terms_.data() + node * nodes * m + i;
                double value = 0.0, slope = 0.0, curvature = 0.0;
                for (std::size_t order_of = nodes; order_of-- > 0;) {
                    value = value * x / static_cast<double>(order_of + 1) + c[order_of * m];
                    if (order_of >= 1) slope = slope * x / static_cast<double>(order_of) + c[order_of * m];
                    if (order_of >= 2) curvature = curvature * x / static_cast<double>(order_of - 1) + c[order_of * m];
                }
                double* const q = watched_.data() + k * 3 * m + i;
                const double unit = 1.0 / static_cast<double>(per_node);
                q[0] += value;
                q[m] += slope * unit / 5.0;
                q[2 * m] += curvature * unit * unit / 20.0;
            }
        }
        exponential::largest_doubt(tall, static_cast<int>(count), watched_.data(), doubt_.data());
        for (std::size_t i = 0; i < m; ++i) margin[i] = doubt_[i] + doubt_[m + i];
        const auto next = [&](int from) {
            return exact::kernels().suspect(tall, from, static_cast<int>(count), 1.0, watched_.data(), margin.data(),
                                            watch.upper().data());
        };
        const auto fallen = [&](int k) {
            const double* q = watched_.data() + static_cast<std::size_t>(k + 1) * 3 * m;
            for (std::size_t i = 0; i < m; ++i)
                if (q[i] < -margin[i] || q[i] > watch.upper()[i] + margin[i]) return true;
            return false;
        };
        bool over = false;
        looked_ = first + count;
        for (int k = next(static_cast<int>(std::max(begin, first) - first)); k < static_cast<int>(count) && !over;
             k = next(k + 1)) {
            suspects_.push_back(first + static_cast<std::size_t>(k));
            over = fallen(k);
        }
        if (!over) continue;
        looked_ = suspects_.back() + 1;
        break;
    }
    std::reverse(suspects_.begin(), suspects_.end());
}

// ------------------------------------------------------------------------------------------- inside a step

// Whether inputs take another form within the step, so that the generator's states are set anew there.
bool Exponential::knotted(double from, double to) const {
    const auto& knots = generator_.knots();
    const auto next = std::upper_bound(knots.begin(), knots.end(), from + instant(from));
    return next != knots.end() && *next <= to + instant(to);
}

// (y, c) → y over one unit of `level`, from t on, through all knots there.
void Exponential::pass(const double* yc, int level, double t, double* y) const {
    const double to = t + std::ldexp(setup_.grid, level);
    if (!knotted(t, to))
        return exact::kernels().multiply(propagators().rows(), propagators().width(), propagators().step(level),
                                         propagators().width(), yc, 1, y);
    std::copy_n(yc, width(), probe_.begin());
    advance(level, t, to);
    std::copy_n(probe_.begin(), rows(), y);
}

// What stands in `probe_` at `from`, c in units of `level`, to its y at `to`. At a knot the inputs' states are set anew.
void Exponential::advance(int level, double from, double to) const {
    const auto& knots = generator_.knots();
    const double unit = std::ldexp(setup_.grid, level);
    for (auto knot = std::upper_bound(knots.begin(), knots.end(), from + instant(from));
         knot != knots.end() && *knot <= to + instant(to); ++knot) {
        advance_freely(level, *knot - from);
        shift(probe_.data() + rows(), driven_.size(), (*knot - from) / unit);
        generator_.set(*knot, setup_.cell, probe_.data() + states_);
        from = *knot;
    }
    advance_freely(level, to - from);
}

// The same between knots; c stays as it was. Over the halvings of the unit that make up the time, and by a series over the
// rest.
void Exponential::advance_freely(int level, double length) const {
    const std::size_t m = driven_.size();
    double* const c = probe_.data() + rows();
    std::copy_n(c, terms * m, kept_.begin());
    double unit = std::ldexp(setup_.grid, level);
    const double little = rounding_of(origin_ + length);
    for (; level >= propagators().finest() && length > little; --level) {
        const double part = std::ldexp(setup_.grid, level);
        if (length < part - little) continue;
        rescale(c, m, part / unit);
        unit = part;
        exact::kernels().multiply(propagators().rows(), propagators().width(), propagators().step(level),
                                  propagators().width(), probe_.data(), 1, scratch_.data());
        std::copy_n(scratch_.begin(), rows(), probe_.begin());
        shift(c, m);
        length -= part;
    }
    if (length > little) {
        rescale(c, m, length / unit);
        propagators().taylor(length, probe_.data(), scratch_.data());
    }
    std::copy_n(kept_.begin(), terms * m, c);
}

// y there, in `probe_` unless it is stored.
const double* Exponential::at(double t) const {
    const auto near = static_cast<std::size_t>(
        std::clamp(std::floor((t - origin_) / stride() + 1e-9), 0.0, static_cast<double>(points_)));
    const double from = origin_ + static_cast<double>(near) * stride();
    if (t - from <= rounding_of(t)) return point(near);
    ++looks_;
    std::copy_n(point(near), width(), probe_.begin());
    advance(walk_level_, from, t);
    return probe_.data();
}

void Exponential::state_at(double t, double* z) const {
    if (t == t_ || !taken_)
        std::copy(z_.begin(), z_.end(), z);
    else
        std::copy_n(at(t), states_, z);
}

void Exponential::quadrature_at(double t, double* q) const {
    const std::size_t m = work_.size();
    if (m == 0) return;
    if (!taken_) {
        std::copy(work_.begin(), work_.end(), q);
        return;
    }
    const double places = std::clamp((t - origin_) / delta_, 0.0, static_cast<double>(intervals));
    const auto node = std::min(static_cast<std::size_t>(places), intervals - 1);
    std::copy(begin_work_.begin(), begin_work_.end(), q);
    for (std::size_t j = 0; j < node; ++j)
        for (std::size_t i = 0; i < nodes; ++i)
            for (std::size_t r = 0; r < m; ++r) q[r] += delta_ * exponential::integrals[j][i] * powers_[i * paths_ + r];
    double power = delta_;
    for (std::size_t k = 0; k < terms; ++k) {
        power *= places - static_cast<double>(node);
        for (std::size_t r = 0; r < m; ++r)
            q[r] += power * inverse_factorial[k + 1] * power_terms_[(node * terms + k) * paths_ + r];
    }
}

void Exponential::go_back(double t) {
    const double* y = at(t);
    quadrature_at(t, work_.data());
    std::copy_n(y, states_, z_.begin());
    t_ = t;
    write_end();
}

// ------------------------------------------------------------------------------------------- for the way back

void Exponential::write_step() const {
    Vector values;
    for (std::size_t j = 0; j < nodes; ++j) values.insert(values.end(), column(j), column(j) + rows());
    values.insert(values.end(), rest_.begin(), rest_.end());
    std::vector<exponential::Step>& taken = setup_.steps->taken;
    setup_.steps->tape.add({.kind = Entry::Kind::steps, .count = static_cast<int>(taken.size())}, values.data(),
                           static_cast<int>(values.size()));
    taken.push_back({now_->tangent, setup_.cell, level_, origin_, delta_, origin_});
}

// How far the last step was used.
void Exponential::write_end() const {
    if (setup_.steps) setup_.steps->taken.back().end = t_;
}

}  // namespace dualdrive
