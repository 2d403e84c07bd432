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

// Whoever stopped the engine may have changed the state; what was not touched keeps its own digits.
template <class R>
void Exact<R>::take_changes() {
    R* y = column(last());
    for (std::size_t k = 0; k < z_.size(); ++k)
        if (static_cast<double>(y[k]) != z_[k]) y[k] = R(z_[k]);
}

template <class R>
auto Exact<R>::present() -> Eigen::Map<const Vector> {
    take_changes();
    return {column(last()), n_};
}

template <class R>
bool Exact<R>::guards_now(double* g) {
    const Vector values = propagator().laws().guards * present();
    for (Eigen::Index k = 0; k < values.size(); ++k) g[k] = static_cast<double>(values(k));
    return values.allFinite();
}

template <class R>
bool Exact<R>::rates_now(double* rate) {
    const Vector values = propagator().laws().A * present();
    for (Eigen::Index k = 0; k < size_.states; ++k) rate[k] = static_cast<double>(values(k));
    return true;
}

template <class R>
std::optional<double> Exact<R>::guard_rate_now(int guard) {
    const Laws<R>& laws = propagator().laws();
    return static_cast<double>(laws.guards.row(guard).dot(laws.A * present()));
}

template <class R>
bool Exact<R>::guard_slopes_now(int guard, double* out) {
    if constexpr (std::is_same_v<R, double>) {
        if (size_.sensitivities == 0) return false;
        slope_propagator().guard(guard, present().data(), slopes(last()), out);
        return true;
    }
    return false;
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
const double* Exact<R>::slopes_at(double t) const {
    const Spot at = spot(t);
    if (at.ahead == 0.0) return slopes(at.column);
    if constexpr (std::is_same_v<R, double>) {
        slope_probe_.assign(slopes(at.column), slopes(at.column) + rows_ * size_.sensitivities);
        slope_y_.assign(column(at.column), column(at.column) + rows_);
        slope_now_->advance(at.ahead, slope_y_.data(), slope_probe_.data());
    }
    return slope_probe_.data();
}

template <class R>
void Exact<R>::sensitivity_at(double t, int k, double* s) const {
    std::copy_n(slopes_at(t) + k * rows_, size_.states, s);
}

template <class R>
bool Exact<R>::signal_slopes_at(double t, double* out) const {
    if constexpr (std::is_same_v<R, double>) {
        if (!slope_now_) return false;
        slope_now_->signals(y_at(spot(t)), slopes_at(t), static_cast<int>(setup_.recorded.size()), out);
        return true;
    }
    return false;
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
void Exact<R>::write_instant(int guard, double rate) {
    if constexpr (std::is_same_v<R, double>) {
        take_changes();  // several switches may come at one instant, and this be between them
        setup_.tape->add({.kind = Entry::Kind::instant, .law = &propagator(), .count = guard, .length = rate},
                         column(last()), rows_);
    }
}

template <class R>
std::vector<Laws<R>> Exact<R>::derivatives(const Propagator<R>* law,
                                           const std::vector<std::vector<std::size_t>>& parameters) {
    for (const auto& [modes, known] : known_)
        if (known.get() == law) return reader_.derivatives(modes, parameters);
    return {};
}

// Where a guard that fell reads one state alone, that state stands where the guard is zero: a gap that is tiny beside the
// twist would drown in the twist's rounding.
template <class R>
void Exact<R>::stand_on_surface() {
    R* y = column(last());
    const auto states = static_cast<Eigen::Index>(size_.states);
    for (const Fall& f : falls_) {
        if (roots_[static_cast<std::size_t>(f.guard)] == 0) continue;
        const auto row = now_->laws().guards.row(f.guard);
        if ((row.array() != R(0)).count() - (row(reader_.one()) != R(0)) != 1) continue;
        for (Eigen::Index k = 0; k < states; ++k)
            if (row(k) != R(0)) y[k] = -row(reader_.one()) / row(k);
    }
}

template <class R>
Solver::Outcome Exact<R>::arrive_at_root() {
    stand_on_surface();
    if (arrive() == Outcome::failed) return Outcome::failed;
    at_root_ = true;
    return Outcome::root;
}

// Watched quantities, their scaled derivatives, and over all steps the bounds of what a quintic does not show of them.
template <class R>
void Exact<R>::watch(int count, R fraction) {
    const int m = now_->watch_rows();
    watched_.resize(static_cast<std::size_t>(3 * m * (block + 2)));
    bounds_.resize(static_cast<std::size_t>(2 * m));
    largest_.resize(static_cast<std::size_t>(rows_));
    if (m == 0) return;
    Arithmetic<R>::multiply(3 * m, n_, now_->watch().data(), rows_, column(0), count + 1, watched_.data());
    Arithmetic<R>::largest(rows_, count, column(0), largest_.data());
    Arithmetic<R>::multiply(2 * m, n_, now_->bounds().data(), rows_, largest_.data(), 1, bounds_.data());
    const R cube = fraction * fraction * fraction, sixth = cube * cube;
    for (int i = 0; i < m; ++i)
        bounds_[static_cast<std::size_t>(i)] =
            bounds_[static_cast<std::size_t>(i)] * sixth + bounds_[static_cast<std::size_t>(m + i)];
}

// The first step of those from `from` on that may hold a crossing: where the Bernstein coefficients of the quintic through
// both ends (value, slope, curvature) do not keep their distance from the limits.
template <class R>
int Exact<R>::suspect(int from, int count, R fraction) const {
    return Arithmetic<R>::suspect(now_->watch_rows(), from, count, fraction, watched_.data(), bounds_.data(),
                                  now_->upper_limits().data());
}

template <class R>
Quintic<R> Exact<R>::quintic(int k, int i, R fraction) const {
    const int m = now_->watch_rows();
    const R *a = watched_.data() + static_cast<std::ptrdiff_t>(k) * 3 * m + i, *b = a + 3 * m;
    const R square = fraction * fraction;
    const R b1 = a[0] + fraction * a[m], b4 = b[0] - fraction * b[m];
    return {{a[0], b1, b1 + fraction * a[m] + square * a[2 * m], b4 - fraction * b[m] + square * b[2 * m], b4, b[0]}};
}

// Where the guard falls first whose power series over the step is in `series_`.
template <class R>
std::optional<R> Exact<R>::fall(const Quintic<R>& q, int terms, R sixth, R noise, bool after_switch) const {
    const bool on_surface = after_switch && series_[0] <= noise;
    if (on_surface && q.leaves_zero(sixth, noise)) return std::nullopt;
    if (!on_surface) {
        const Verdict verdict = q.judge(sixth, noise);
        if (verdict == Verdict::none) return std::nullopt;
        if (verdict == Verdict::one) return polish_root(series_.data(), terms, q.root());
    }
    return FirstFall<R>(series_.data(), terms, noise, on_surface).find();
}

// The earliest crossing within step k, from the power series of all quantities; marks the guards that fall there, those
// included that rounding alone tells apart.
template <class R>
std::optional<R> Exact<R>::first_fall(int k, R fraction) {
    ++counts_.guards;
    const int m = now_->watch_rows(), terms = now_->terms();
    const R* noise = bounds_.data() + m;
    falls_.clear();
    series_.resize(static_cast<std::size_t>(padded(terms)));
    for (std::size_t i = 0; i < now_->watched().size(); ++i) {
        const auto& quantity = now_->watched()[i];
        Quintic<R> q = quintic(k, static_cast<int>(i), fraction);
        const auto [least, largest] = std::minmax_element(q.b.begin(), q.b.end());
        if (*least > bounds_[i] && *largest + bounds_[i] < quantity.upper) continue;
        Arithmetic<R>::multiply(padded(terms), n_, now_->series(i).data(), rows_, column(k), 1, series_.data());
        R power(1);
        for (int j = 1; j < terms && fraction != R(1); ++j) series_[static_cast<std::size_t>(j)] *= power *= fraction;
        const R sixth = sixth_derivative(series_.data(), terms);
        const int left = terms_above(series_.data(), terms, noise[i] / R(16));
        const auto look = [&](int guard) {
            if (const auto x = fall(q, left, sixth, noise[i], fresh_ && k == 0))
                falls_.push_back({*x * fraction, guard});
        };
        look(quantity.low);
        if (quantity.high < 0) continue;
        for (R& c : series_) c = -c;
        series_[0] += quantity.upper;
        for (R& c : q.b) c = quantity.upper - c;
        look(quantity.high);
    }
    if (falls_.empty()) return std::nullopt;
    R first = falls_.front().at;
    for (const Fall& f : falls_) first = std::min(first, f.at);
    const R same = R(100 * std::numeric_limits<double>::epsilon() * (std::abs(t_) / now_->step() + 1.0));
    std::fill(roots_.begin(), roots_.end(), 0);
    for (const Fall& f : falls_)
        if (f.at - first <= same) roots_[static_cast<std::size_t>(f.guard)] = -1;
    return first;
}

template <class R>
typename Exact<R>::Spot Exact<R>::spot(double t) const {
    if (std::abs(t - t_) <= instant(t)) return {last(), 0.0};
    const int k = std::clamp(static_cast<int>((t - begin_) / now_->step() + 1e-9), 0, done_);
    const double ahead = t - time_of(k);
    return {k, std::abs(ahead) <= instant(t) ? 0.0 : std::max(0.0, ahead)};
}

template <class R>
const R* Exact<R>::y_at(const Spot& at) const {
    if (at.ahead == 0.0) return column(at.column);
    std::copy_n(column(at.column), rows_, probe_.data());
    now_->advance(probe_.data(), R(at.ahead), probe_scratch_.data());
    return probe_.data();
}

template <class R>
void Exact<R>::state_at(double t, double* z) const {
    const R* y = y_at(spot(t));
    for (int k = 0; k < size_.states; ++k) z[k] = static_cast<double>(y[k]);
}

// Columns in a row, as outputs on the grid are, take one product.
template <class R>
bool Exact<R>::signals_at(std::span<const double> times, double* signals) const {
    const std::size_t width = setup_.recorded.size();
    for (std::size_t k = 0; k < times.size();) {
        const Spot at = spot(times[k]);
        int together = 1;
        for (; at.ahead == 0.0 && k + static_cast<std::size_t>(together) < times.size(); ++together) {
            const Spot next = spot(times[k + static_cast<std::size_t>(together)]);
            if (next.ahead != 0.0 || next.column != at.column + together) break;
        }
        rows_of(y_at(at), together, signals + k * width);
        if constexpr (std::is_same_v<R, double>)
            for (int j = 0; setup_.tape && j < together; ++j)
                setup_.tape->add_output(now_, last() == 0 ? -1 : at.column + j, at.ahead, y_at(at), rows_);
        k += static_cast<std::size_t>(together);
    }
    return true;
}

// The recorded signals of `count` states.
template <class R>
void Exact<R>::rows_of(const R* y, int count, double* signals) const {
    const int m = now_->outputs();
    const auto width = static_cast<int>(setup_.recorded.size());
    if constexpr (std::is_same_v<R, double>)
        if (m == width) return Arithmetic<R>::multiply(m, n_, now_->output_rows().data(), rows_, y, count, signals);
    probe_signals_.resize(static_cast<std::size_t>(m * count));
    Arithmetic<R>::multiply(m, n_, now_->output_rows().data(), rows_, y, count, probe_signals_.data());
    for (int k = 0; k < count; ++k)
        for (int s = 0; s < width; ++s)
            signals[k * width + s] = static_cast<double>(probe_signals_[static_cast<std::size_t>(k * m + s)]);
}

template <class R>
void Exact<R>::go_back(double t) {
    const R* y = y_at(spot(t));
    std::vector<R> there(y, y + rows_);
    quadrature_at(t, work(0));
    if (slope_now_) {
        const std::vector<double> S(slopes_at(t), slopes_at(t) + rows_ * size_.sensitivities);
        std::copy(S.begin(), S.end(), slopes(0));
    }
    std::copy(there.begin(), there.end(), column(0));
    done_ = 0;
    ended_ = false;
    for (std::size_t k = 0; k < z_.size(); ++k) z_[k] = static_cast<double>(there[k]);
    t_ = t;
}

template <class R>
void Exact<R>::quadrature_at(double t, double* q) const {
    if (!ledger_) return;
    const Spot at = spot(t);
    std::copy_n(work(at.column), size_.quadratures, q);
    ledger_->add_part(column(at.column), R(at.ahead), q);
}

template <class R>
std::optional<double> Exact<R>::stored_energy_at(double t) const {
    if (!ledger_) return std::nullopt;
    return ledger_->stored(y_at(spot(t)));
}

template class Exact<double>;
template class Exact<long double>;

}  // namespace dualdrive::exact
