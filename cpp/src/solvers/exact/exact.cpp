#include "exact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../../simulation/instant.hpp"
#include "arithmetic.hpp"
#include "crossing.hpp"

namespace dualdrive::exact {

template <class R>
Exact<R>::Exact(Size size, Setup setup)
    : size_(size),
      setup_(std::move(setup)),
      generator_(setup_.inputs),
      reader_(setup_.machine, setup_.inputs, setup_.layout, generator_, setup_.recorded),
      n_(reader_.size()),
      rows_(padded(n_)),
      y_(static_cast<std::size_t>(rows_) * (block + 2), R(0)),
      scratch_(static_cast<std::size_t>(rows_) * 2),
      probe_(static_cast<std::size_t>(rows_)),
      probe_scratch_(static_cast<std::size_t>(rows_) * 2),
      z_(static_cast<std::size_t>(size.states), 0.0),
      works_(static_cast<std::size_t>(size.quadratures) * (block + 2), 0.0),
      slopes_(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(size.sensitivities) * (block + 2), 0.0),
      roots_(static_cast<std::size_t>(size.guards), 0) {
    y_[static_cast<std::size_t>(reader_.one())] = R(1);
    if (setup_.tape) setup_.tape->values.reserve((setup_.steps + setup_.steps / 4) * static_cast<std::size_t>(rows_));
}

// Of the modes as they are.
template <class R>
const Propagator<R>& Exact<R>::propagator() {
    auto& known = known_[setup_.modes];
    if (!known) {
        known = std::make_unique<Propagator<R>>(reader_.read(setup_.modes), setup_.grid);
        ++counts_.jacobians;
    }
    return *known;
}

template <class R>
void Exact<R>::take_modes() {
    now_ = &propagator();
    if (size_.quadratures > 0) {
        auto& ledger = known_ledgers_[now_];
        if (!ledger) ledger = std::make_unique<Ledger<R>>(reader_.energies(setup_.modes), *now_);
        ledger_ = ledger.get();
    }
    if constexpr (std::is_same_v<R, double>)
        if (size_.sensitivities > 0) slope_now_ = &slope_propagator();
}

template <class R>
SlopePropagator& Exact<R>::slope_propagator() {
    const Propagator<R>& now = propagator();
    auto& known = known_slopes_[&now];
    if constexpr (std::is_same_v<R, double>)
        if (!known)
            known = std::make_unique<SlopePropagator>(now, reader_.derivatives(setup_.modes, setup_.parameters));
    return *known;
}

template <class R>
void Exact<R>::restart(double t, std::span<const double>, double) {
    begin_again();
    take_changes();
    take_modes();
    find_place(t);
    begin_ = t_;
    fresh_ = true;
    wide_ = 2;
    start_generator(t_);
}

// The end of the last step is the begin of the next.
template <class R>
void Exact<R>::begin_again() {
    if (last() > 0) {
        std::copy_n(column(last()), rows_, column(0));
        std::copy_n(work(last()), size_.quadratures, work(0));
        std::copy_n(slopes(last()), rows_ * size_.sensitivities, slopes(0));
    }
    done_ = 0;
    ended_ = false;
    begin_ = t_;
}

// The grid step and the step within it that hold t. Right after one's own switch the local time is known better than t.
template <class R>
void Exact<R>::find_place(double t) {
    if (t != t_ || now_ == nullptr) {
        place_ = static_cast<long>(std::floor((t - setup_.start) / setup_.grid + 1e-9));
        local_ = R(t - grid_time(place_));
        if (std::abs(static_cast<double>(local_)) <= instant(t)) local_ = R(0);
        t_ = t;
    }
    part_ = static_cast<long>(std::floor(static_cast<double>(local_) / now_->step() + 1e-9));
    if (std::abs(static_cast<double>(local_) - static_cast<double>(part_) * now_->step()) <= instant(t))
        local_ = R(static_cast<double>(part_) * now_->step());
    next_place();
}

template <class R>
void Exact<R>::next_place() {
    const long parts = 1L << now_->halvings();
    if (part_ < parts) return;
    place_ += part_ / parts;
    part_ %= parts;
    local_ = R(static_cast<double>(part_) * now_->step());
}

// Sets the inputs' states for what follows; returns the time up to which they hold, at most `stop`.
template <class R>
double Exact<R>::start_generator(double stop) {
    const auto& knots = generator_.knots();
    const std::size_t passed = next_knot_;
    while (next_knot_ < knots.size() && knots[next_knot_] <= t_ + instant(t_)) ++next_knot_;
    // at a knot its own time, lest rounding leaves it on the far side
    const double from = next_knot_ > 0 ? std::max(t_, knots[next_knot_ - 1]) : t_;
    // t_ is rounded: set anew at a switch, the inputs would jump off the surface on which it stands.
    if (!at_root_ || next_knot_ > passed) generator_.set(from, setup_.cell, column(0) + size_.states);
    return next_knot_ < knots.size() ? std::min(stop, knots[next_knot_]) : stop;
}

template <class R>
Solver::Outcome Exact<R>::step(double stop) {
    begin_again();
    const double target = start_generator(stop);
    const double left = target - t_, h = now_->step();
    Outcome outcome;
    if (const auto whole = static_cast<long>((left + instant(t_)) / h); aligned() && whole > 0) {
        outcome = walk(static_cast<int>(std::min<long>(whole, wide_)));
    } else {
        const R boundary = R(static_cast<double>(part_ + 1) * h), end = R(target - grid_time(place_));
        const bool whole_step = std::abs(static_cast<double>(boundary - end)) <= instant(t_);
        outcome = end < boundary && !whole_step ? go_to(end, false) : go_to(boundary, true);
    }
    if (outcome == Outcome::stepped && t_ >= stop - instant(t_)) {
        t_ = stop;
        return Outcome::stopped;
    }
    return outcome;
}

// Whole steps, all at once; where one of them may hold a crossing it is looked at closely.
template <class R>
Solver::Outcome Exact<R>::walk(int count) {
    Arithmetic<R>::chain(rows_, n_, now_->power(0).data(), count, column(0));
    watch(count, R(1));
    for (int k = suspect(0, count, R(1)); k < count; k = suspect(k + 1, count, R(1)))
        if (const auto fall = first_fall(k, R(1))) {
            take_steps(k);
            take_part(*fall * R(now_->step()));
            return arrive_at_root();
        }
    take_steps(count);
    wide_ = std::min(block, 2 * wide_);
    return arrive();
}

// A part of a step, to `end` or to the end of the step.
template <class R>
Solver::Outcome Exact<R>::go_to(R end, bool boundary) {
    const R length = end - local_, fraction = length / R(now_->step());
    take_part(length);
    watch(1, fraction);
    if (suspect(0, 1, fraction) == 0)
        if (const auto fall = first_fall(0, fraction)) {
            local_ -= length;
            take_part(*fall * R(now_->step()));
            return arrive_at_root();
        }
    if (boundary) {
        ++part_;
        local_ = R(static_cast<double>(part_) * now_->step());
        next_place();
    }
    return arrive();
}

template <class R>
void Exact<R>::take_steps(int count) {
    done_ = count;
    part_ += count;
    if (count == 0) return;
    local_ = R(static_cast<double>(part_) * now_->step());
    next_place();
}

template <class R>
void Exact<R>::take_part(R length) {
    std::copy_n(column(done_), rows_, column(done_ + 1));
    now_->advance(column(done_ + 1), length, scratch_.data());
    local_ += length;
    part_length_ = length;
    ended_ = true;
}

// The sensitivities from column k to the next one.
template <class R>
void Exact<R>::take_slopes(int k, double length) {
    if constexpr (std::is_same_v<R, double>) {
        std::copy_n(slopes(k), rows_ * size_.sensitivities, slopes(k + 1));
        if (k < done_) return slope_now_->step(0, column(k), slopes(k + 1));
        slope_y_.assign(column(k), column(k) + rows_);
        slope_now_->advance(length, slope_y_.data(), slopes(k + 1));
    }
}

template <class R>
Solver::Outcome Exact<R>::arrive() {
    const double end = static_cast<double>(R(grid_time(place_)) + local_);
    const R* y = column(last());
    for (std::size_t k = 0; k < z_.size(); ++k) z_[k] = static_cast<double>(y[k]);
    fresh_ = at_root_ = false;
    counts_.steps += last();
    if (!std::all_of(z_.begin(), z_.end(), [](double x) { return std::isfinite(x); })) return Outcome::failed;
    for (int k = 0; slope_now_ && k < last(); ++k)
        take_slopes(k, k < done_ ? now_->step() : static_cast<double>(part_length_));
    for (int k = 0; ledger_ && k < last(); ++k) {
        std::copy_n(work(k), size_.quadratures, work(k + 1));
        if (k < done_)
            ledger_->add_step(column(k), work(k + 1));
        else
            ledger_->add_part(column(k), part_length_, work(k + 1));
    }
    t_ = end;
    if constexpr (std::is_same_v<R, double>)
        if (setup_.tape)
            setup_.tape->add({.kind = Entry::Kind::steps,
                              .law = now_,
                              .count = done_,
                              .column = ended_ ? 1 : 0,
                              .length = part_length_},
                             column(0), rows_ * (last() + 1));
    return Outcome::stepped;
}

template <class R>
Solver::Outcome Exact<R>::arrive_at_root() {
    stand_on_surface();
    if (arrive() == Outcome::failed) return Outcome::failed;
    at_root_ = true;
    return Outcome::root;
}

}  // namespace dualdrive::exact

#include "exact_state.ipp"
#include "exact_watch.ipp"

namespace dualdrive::exact {

template class Exact<double>;
template class Exact<long double>;

}  // namespace dualdrive::exact
