#include "exponential.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "../../simulation/instant.hpp"
#include "../exact/kernels.hpp"

namespace dualdrive {

namespace {

using exponential::backward, exponential::last_gram, exponential::most_back, exponential::through_nodes;

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double shortest = 16.0 * std::numeric_limits<double>::epsilon();  // distance of nodes, of the time
constexpr double order = 9.0;  // the error of a step goes with this power of its length
constexpr int first_halvings = 6;      // of the grid: the first step
constexpr int after_switch = 2;        // halvings of the step before, as a switch may leave something fast
constexpr double doubles = 1e-3;       // errors below it allow a step twice as long: 2⁻⁹, and half of that
constexpr double enough = 0.1;         // of what a step may err by: what sweeps may leave
constexpr double least_contraction = 0.05, slow = 0.3;  // a sweep's, as reckoned with; and at which a step is too long
constexpr double fades = 0.7;  // what is known of it, with every step that did not show it
constexpr int most_sweeps = 8;
constexpr double negligible = 1e-4;    // of what a step may err by: a rest that small is none
constexpr double rounding = 1024.0 * std::numeric_limits<double>::epsilon();  // of the largest term of a rate, and more
constexpr int levels_of_a_bad_number = 2;
constexpr double shape_area = 40.0;    // of |last_gram|'s polynomial between the nodes, about
constexpr int worth_a_tangent = 16;    // steps that its propagators cost
constexpr double farthest = 8e-3;      // s, between nodes: a drive's own loops follow what takes longer; no law hides there
constexpr int coarser = 4;             // doublings of the finest step: a stretch of the walk
constexpr std::size_t chunk = 16;      // stretches that are looked at together
constexpr double straight = 0.01;      // of what a guard keeps off zero: a bend of less is a doubt, no more

constexpr std::size_t terms = exponential::nodes;

constexpr std::array<double, terms + 1> inverse_factorial = [] {
    std::array<double, terms + 1> f{1.0};
    for (std::size_t k = 1; k < f.size(); ++k) f[k] = f[k - 1] / static_cast<double>(k);
    return f;
}();

// Over the interval from node j on, of the polynomial through the nodes.
constexpr auto integrals = [] {
    std::array<std::array<double, terms>, terms> w{};
    for (std::size_t j = 0; j < terms; ++j)
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t i = 0; i < terms; ++i) w[j][i] += through_nodes[j][k][i] * inverse_factorial[k + 1];
    return w;
}();

// Derivatives at node j of the polynomial `last_gram`.
constexpr auto gram_derivatives = [] {
    std::array<std::array<double, terms>, terms> d{};
    for (std::size_t j = 0; j < terms; ++j)
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t i = 0; i < terms; ++i) d[j][k] += through_nodes[j][k][i] * last_gram[i];
    return d;
}();

// c, derivatives in one unit of time, in another `ratio` times as long.
void rescale(double* c, std::size_t m, double ratio) {
    double power = 1.0;
    for (std::size_t k = 0; k < terms; ++k, power *= ratio)
        for (std::size_t r = 0; r < m; ++r) c[k * m + r] *= power;
}

// Derivatives at every node of the polynomials through `values`, [node][width] with a padded width: [node][order][width].
void expand(const std::vector<double>& values, int width, std::vector<double>& out) {
    out.resize(terms * terms * static_cast<std::size_t>(width));
    exact::kernels().product(width, static_cast<int>(terms), values.data(), static_cast<int>(terms),
                             through_nodes[0][0].data(), static_cast<int>(terms * terms), out.data());
}

// c so many units of time later.
void shift(double* c, std::size_t m, double units = 1.0) {
    for (std::size_t k = 0; k < terms; ++k) {
        double power = 1.0;
        for (std::size_t j = k + 1; j < terms; ++j) {
            power *= units;
            for (std::size_t r = 0; r < m; ++r) c[k * m + r] += power * inverse_factorial[j - k] * c[j * m + r];
        }
    }
}

}  // namespace

Exponential::Exponential(Problem& problem, Size size, double rtol, Setup setup)
    : problem_(problem),
      size_(size),
      rtol_(rtol),
      setup_(setup),
      generator_(setup.inputs),
      reader_(setup.machine, setup.inputs, setup.layout, generator_, nothing_),
      states_(static_cast<std::size_t>(size.states)),
      one_(static_cast<std::size_t>(reader_.one())),
      guard_count_(static_cast<std::size_t>(size.guards)),
      next_level_(-first_halvings),
      z_(states_, 0.0),
      work_(static_cast<std::size_t>(size.quadratures), 0.0),
      weight_(states_, 0.0),
      paths_(static_cast<std::size_t>(exact::padded(size.quadratures))),
      powers_(nodes * paths_, 0.0),
      begin_work_(work_),
      guards_(nodes * guard_count_, 1.0),
      rate_(states_, 0.0),
      before_(states_, 0.0) {}

void Exponential::restart(double t, std::span<const double> atol, double quadrature_atol) {
    t_ = begin_ = t;
    atol_.assign(atol.begin(), atol.end());
    quadrature_atol_ = quadrature_atol;
    now_ = nullptr;
    past_.clear();
    if (counts_.steps > 0 && setup_.modes != modes_) next_level_ = std::max(next_level_ - after_switch, -first_halvings);
    modes_ = setup_.modes;
    taken_ = false;
}

// What the machine's inputs do between nodes is known: nothing can be stepped over unseen, but for what laws make of it.
void Exponential::limit_step(double longest, double turning) {
    longest_ = std::min(longest, static_cast<double>(intervals) * std::min(turning, farthest));
}

// ------------------------------------------------------------------------------------------- modes

// The tangent in these modes, where they are met first; and a new one where sweeps alone have kept steps short, as seldom as
// what it costs. Other states may show more rows that the rest acts on.
void Exponential::take_modes() {
    auto& known = known_[setup_.modes];
    if (!known || known->held >= worth_a_tangent) {
        const exact::Laws<double> laws = reader_.tangent(setup_.modes, t_, z_.data());
        known.reset(new Frozen{{laws.A, driven_, setup_.grid}, {laws, driven_, setup_.grid}, 0});
        ++counts_.jacobians;
    }
    now_ = known.get();
    padded_ = static_cast<std::size_t>(exact::padded(static_cast<int>(driven_.size())));
    linear_.assign(rows(), 0.0);
    scratch_.assign(2 * rows(), 0.0);
    probe_.assign(width(), 0.0);
    kept_.assign(width(), 0.0);
    yc_.assign(nodes * width(), 0.0);
    rest_.assign(nodes * padded_, 0.0);
}

// False where the laws give no number, or rows are driven that were not.
bool Exponential::rest_at(double t, const double* y, double* rest) {
    ++counts_.rhs;
    finite_ = problem_.rhs(t, y, rate_.data());
    if (!finite_) return false;
    propagators().rates(y, linear_.data());
    std::vector<int> driven;  // with those that were not yet
    std::size_t r = 0;
    for (std::size_t i = 0; i < states_; ++i) {
        const double n = rate_[i] - linear_[i];
        if (r < driven_.size() && driven_[r] == static_cast<int>(i))
            rest[r++] = n;
        else if (std::abs(n) * delta_ * weight_[i] > negligible &&
                 std::abs(n) > rounding * propagators().largest_term(static_cast<int>(i), y))
            driven.push_back(static_cast<int>(i));
    }
    if (driven.empty()) return true;
    driven.insert(driven.end(), driven_.begin(), driven_.end());
    std::sort(driven.begin(), driven.end());
    driven_ = std::move(driven);
    more_driven_ = true;

    return false;
}

// The rest at a node, and powers and guards there.
bool Exponential::evaluate(std::size_t node) {
    const double t = node_time(node);
    const double* y = column(node);
    if (!rest_at(t, y, rest_.data() + node * padded_)) return false;
    finite_ = (work_.empty() || problem_.quadrature(t, y, powers_.data() + node * paths_)) &&
              (guard_count_ == 0 || problem_.guards(t, y, guards_.data() + node * guard_count_));
    return finite_;
}

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
    const double little = instant(origin_ + length);
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

// ------------------------------------------------------------------------------------------- one step

Solver::Outcome Exponential::step(double stop) {
    begin_ = t_;
    const double least = shortest * std::max(std::abs(t_), std::abs(stop));
    if (stop - t_ <= least) {
        t_ = stop;
        return Outcome::stopped;
    }
    if (taken_ && t_ < end_ && end_ <= stop) return deliver(stop);
    if (now_ && now_->held >= worth_a_tangent) {
        now_ = nullptr;
        past_.clear();
    }
    origin_ = t_;
    begin_work_ = work_;
    int level = next_level_;
    const auto reach = [&] { return std::ldexp(setup_.grid, level) * static_cast<double>(intervals); };
    while (reach() > longest_ || reach() >= 2.0 * (stop - t_)) --level;
    const int wanted = level;
    double e = infinite;
    for (;;) {
        if (reach() <= least) return Outcome::failed;
        more_driven_ = false;
        e = try_step(level);
        if (e <= 1.0) {
            end_ = end_before(stop);
            walk();
            look_for_suspects();
            e = std::max(e, defect_of_suspects());
        }
        if (more_driven_) {
            known_.clear();
            now_ = nullptr;
            past_.clear();
            continue;
        }
        if (e <= 1.0) break;
        ++counts_.error_test_failures;
        level -= e < infinite ? std::max(1, static_cast<int>(std::ceil(std::log2(e) / order))) : levels_of_a_bad_number;
    }
    ++counts_.steps;
    limited_ = e <= doubles || level < wanted ? limited_ : 0;
    if (level < wanted)
        next_level_ = level;
    else if (e <= doubles && level == next_level_) {
        if (2.0 * contraction_ <= slow)
            ++next_level_;
        else
            ++now_->held, ++limited_;
    }
    past_ = rest_;
    past_origin_ = origin_;
    past_delta_ = delta_;
    if (!work_.empty()) expand(powers_, static_cast<int>(paths_), power_terms_);
    taken_ = true;
    return deliver(stop);
}

// A step ends with its last node, or where it passes `stop`; one that began off the grid ends on it.
double Exponential::end_before(double stop) const {
    const double end = node_time(intervals);
    if (end >= stop - instant(stop)) return stop;
    const double on_grid = setup_.start + std::floor((end + instant(end) - setup_.start) / setup_.grid) * setup_.grid;
    return on_grid >= node_time(intervals / 2) ? on_grid : end;
}

// At a knot its own time, lest rounding leaves the inputs on the far side.
double Exponential::begin_of_inputs() const {
    const auto& knots = generator_.knots();
    const auto next = std::lower_bound(knots.begin(), knots.end(), origin_ - instant(origin_));
    return next != knots.end() && *next <= origin_ + instant(origin_) ? *next : origin_;
}

double Exponential::try_step(int level) {
    if (level != level_) contraction_ *= std::ldexp(1.0, level - level_);
    level_ = level;
    delta_ = std::ldexp(setup_.grid, level);
    for (std::size_t i = 0; i < states_; ++i) weight_[i] = 1.0 / (atol_[i] + rtol_ * std::abs(z_[i]));
    if (!now_) take_modes();
    std::copy(z_.begin(), z_.end(), column(0));
    column(0)[one_] = 1.0;
    generator_.set(begin_of_inputs(), setup_.cell, column(0) + states_);
    if (!evaluate(0) || !predict()) return infinite;
    for (std::size_t i = 0; i < states_; ++i)
        weight_[i] = 1.0 / (atol_[i] + rtol_ * std::max(std::abs(z_[i]), std::abs(column(intervals)[i])));
    double moved = sweep();
    contraction_ *= fades;
    for (int k = 0; !(moved * std::max(contraction_, least_contraction) <= enough); ++k) {
        if (k == most_sweeps || !(moved < infinite) || !evaluate_nodes()) return infinite;
        const double next = sweep();
        contraction_ = next / moved;
        if (!(contraction_ < slow) && next > enough) return infinite;
        moved = next;
    }
    return std::max({interpolation_error(), work_error(), defect()});
}

// An exponential Adams–Bashforth method from node to node (S. Nørsett, 1969; M. Hochbruck, A. Ostermann, BIT 51 (2011)
// 889–908), by as many values as are known, those of the step before included.
bool Exponential::predict() {
    const std::size_t m = driven_.size();
    std::vector<double> values(most_back * m);  // of the past, the latest first
    std::size_t known = 0;
    if (!past_.empty())
        for (; known + 1 < most_back; ++known) {
            const double back = static_cast<double>(known + 1);
            if (origin_ - back * delta_ < past_origin_ - instant(origin_)) break;
            for (std::size_t r = 0; r < m; ++r) values[known * m + r] = past(back, r);
        }
    for (std::size_t j = 0; j < intervals; ++j) {
        double* const c = column(j) + rows();
        const std::size_t p = std::min(most_back, j + 1 + known);
        for (std::size_t k = 0; k < p; ++k)
            for (std::size_t r = 0; r < m; ++r) {
                double sum = 0.0;
                for (std::size_t i = 0; i < p; ++i)
                    sum += backward[p - 1][k][i] * (i <= j ? rest_[(j - i) * padded_ + r] : values[(i - j - 1) * m + r]);
                c[k * m + r] = sum;
            }
        std::fill_n(c + p * m, (terms - p) * m, 0.0);
        pass(column(j), level_, node_time(j), column(j + 1));
        if (!evaluate(j + 1)) return false;
    }
    return true;
}

// The rest of the step before, so many places back.
double Exponential::past(double places, std::size_t row) const {
    const double x = (origin_ - places * delta_ - past_origin_) / past_delta_;
    double above = 0.0, below = 0.0;  // the barycentric formula; its weights are last_gram
    for (std::size_t i = 0; i < nodes; ++i) {
        const double apart = x - static_cast<double>(i);
        if (std::abs(apart) < 1e-9) return past_[i * padded_ + row];
        above += last_gram[i] / apart * past_[i * padded_ + row];
        below += last_gram[i] / apart;
    }
    return above / below;
}

// The states again, by the polynomial through all values of the rest; returns how far they moved.
double Exponential::sweep() {
    const std::size_t m = driven_.size();
    if (m > 0) expand(rest_, static_cast<int>(padded_), rest_terms_);
    for (std::size_t k = 0; k < nodes * terms; ++k)
        std::copy_n(rest_terms_.data() + k * padded_, m, column(k / terms) + rows() + k % terms * m);
    double most = 0.0;
    for (std::size_t j = 0; j < intervals; ++j) {
        double* const next = column(j + 1);
        std::copy_n(next, states_, before_.begin());
        pass(column(j), level_, node_time(j), next);
        for (std::size_t i = 0; i < states_; ++i) before_[i] = next[i] - before_[i];
        most = std::max(most, norm(before_.data()));
    }
    return most;
}

bool Exponential::evaluate_nodes() {
    for (std::size_t j = 1; j < nodes; ++j)
        if (!evaluate(j)) return false;
    return true;
}

double Exponential::norm(const double* y) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < states_; ++i) sum += weight_[i] * y[i] * weight_[i] * y[i];
    return std::isfinite(sum) ? std::sqrt(sum / static_cast<double>(states_)) : infinite;
}

// ------------------------------------------------------------------------------------------- errors

// What the last of the polynomials that are orthogonal over the nodes, as far as the rest holds it, does to the states.
double Exponential::interpolation_error() const {
    const std::size_t m = driven_.size();
    const double* const M = propagators().step(level_);
    Vector share(m, 0.0), e(width(), 0.0), next(rows());
    for (std::size_t r = 0; r < m; ++r) {
        for (std::size_t i = 0; i < nodes; ++i) share[r] += last_gram[i] * rest_[i * padded_ + r];
        share[r] /= exponential::last_gram_square;
    }
    double most = 0.0;
    for (std::size_t j = 0; j < intervals; ++j) {
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t r = 0; r < m; ++r) e[rows() + k * m + r] = gram_derivatives[j][k] * share[r];
        exact::kernels().multiply(propagators().rows(), propagators().width(), M, propagators().width(), e.data(), 1, next.data());
        std::copy(next.begin(), next.end(), e.begin());
        most = std::max(most, norm(e.data()));
    }
    return most;
}

// How far the polynomial is from the rest between the first two nodes, over the time between them: there it fits worst,
// and something fast that dies away is seen.
double Exponential::defect() { return defect(column(0), origin_, level_ - 1); }

// The same in the middle of the stretches where a guard may come to zero: a law may be at its steepest where it ends, as
// friction is that falls with speed.
double Exponential::defect_of_suspects() {
    double most = 0.0;
    for (std::size_t k = 0; k < std::min(suspects_.size(), chunk) && most < infinite; ++k) {
        const std::size_t from = suspects_[suspects_.size() - 1 - k];
        most = std::max(most, defect(point(from), origin_ + static_cast<double>(from) * stride(), walk_level_ - 1));
    }
    return most;
}

// At half the unit of c after (y, c), which is a step of `level`.
double Exponential::defect(const double* yc, double t, int level) {
    const std::size_t m = driven_.size();
    if (m == 0) return 0.0;
    Vector half(yc, yc + width()), y(rows()), rest(m), apart(states_, 0.0);
    rescale(half.data() + rows(), m, 0.5);
    pass(half.data(), level, t, y.data());
    shift(half.data() + rows(), m);
    if (!rest_at(t + std::ldexp(setup_.grid, level), y.data(), rest.data())) return infinite;
    for (std::size_t r = 0; r < m; ++r)
        apart[static_cast<std::size_t>(driven_[r])] = delta_ * (rest[r] - half[rows() + r]);
    return norm(apart.data());
}

// The same of the powers, over the area of that polynomial.
double Exponential::work_error() const {
    const std::size_t m = work_.size();
    double sum = 0.0;
    for (std::size_t r = 0; r < m; ++r) {
        double share = 0.0;
        for (std::size_t i = 0; i < nodes; ++i) share += last_gram[i] * powers_[i * paths_ + r];
        const double e = delta_ * shape_area * share / exponential::last_gram_square /
                         (quadrature_atol_ + rtol_ * std::abs(work_[r]));
        sum += e * e;
    }
    return m > 0 ? std::sqrt(sum / static_cast<double>(m)) : 0.0;
}

// ------------------------------------------------------------------------------------------- the step in pieces

// Up to the next suspect, or over it.
Solver::Outcome Exponential::deliver(double stop) {
    const auto last = static_cast<std::size_t>(std::ceil((end_ - origin_) / stride() - 1e-9));
    keeps_off_ = suspects_.empty() || suspects_.back() != position_;
    if (!keeps_off_) {
        suspects_.pop_back();
        ++position_;
    } else {
        position_ = suspects_.empty() ? last : std::min(last, suspects_.back());
    }
    const double t = position_ >= last ? end_ : origin_ + static_cast<double>(position_) * stride();
    const double* y = at(t);
    quadrature_at(t, work_.data());
    std::copy_n(y, states_, z_.begin());
    t_ = t;
    return t == stop ? Outcome::stopped : Outcome::stepped;
}

// y and c on points as near to each other as the walk needs them, up to the end of the step at least.
void Exponential::walk() {
    walk_level_ = std::min({level_, 0, propagators().finest() + coarser}) - finer_;
    const std::size_t m = driven_.size(), per_node = std::size_t{1} << (level_ - walk_level_), all = intervals * per_node;
    const auto needed = static_cast<std::size_t>(std::ceil((end_ - origin_) / stride() - 1e-9));
    points_ = std::min(all, (needed + 1) / 2 * 2);
    position_ = 0;
    counts_.guards += static_cast<long>(points_);
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
            const double value = guards_[j * guard_count_ + static_cast<std::size_t>(q.low)], bend = value - linear[j * tall + i];
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

// The stretches of the walk over which the quintic through both ends does not keep off zero by what it is doubted by.
void Exponential::look_for_suspects() {
    suspects_.clear();
    if (guard_count_ == 0) return;
    find_bends();
    exponential::Watch& watch = now_->watch;
    const std::vector<double>& W = watch.matrix(walk_level_);
    const int tall = watch.rows();
    const auto m = static_cast<std::size_t>(tall), per_node = std::size_t{1} << (level_ - walk_level_);
    std::vector<double> margin(m);
    watched_.resize(3 * m * (chunk + 1));
    for (std::size_t first = 0; first < points_; first += chunk) {
        const std::size_t count = std::min(chunk, points_ - first);
        exact::kernels().multiply(3 * tall, static_cast<int>(rows() + 2 * driven_.size()), W.data(), propagators().width(),
                                  point(first), static_cast<int>(count) + 1, watched_.data());
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
        // What comes after a fall is no solution: the modes are others there.
        const auto fallen = [&](int k) {
            const double* q = watched_.data() + static_cast<std::size_t>(k + 1) * 3 * m;
            for (std::size_t i = 0; i < m; ++i)
                if (q[i] < -margin[i] || q[i] > watch.upper()[i] + margin[i]) return true;
            return false;
        };
        bool over = false;
        for (int k = next(0); k < static_cast<int>(count) && !over; k = next(k + 1)) {
            suspects_.push_back(first + static_cast<std::size_t>(k));
            over = fallen(k);
        }
        if (over) break;
    }
    if (4 * suspects_.size() > points_ && walk_level_ > propagators().finest())
        ++finer_;
    else if (suspects_.empty() && finer_ > 0)
        --finer_;
    std::reverse(suspects_.begin(), suspects_.end());
}

// ------------------------------------------------------------------------------------------- inside a step

// y there, in `probe_` unless it is stored.
const double* Exponential::at(double t) const {
    const auto near = static_cast<std::size_t>(
        std::clamp(std::floor((t - origin_) / stride() + 1e-9), 0.0, static_cast<double>(points_)));
    const double from = origin_ + static_cast<double>(near) * stride();
    if (t - from <= instant(t) || near == points_) return point(near);
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
            for (std::size_t r = 0; r < m; ++r) q[r] += delta_ * integrals[j][i] * powers_[i * paths_ + r];
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
}

Solver::Failure Exponential::failure() const {
    if (!finite_) return {false, not_finite};
    return {true,
            "the step size fell to nothing; look for a law or a motion that goes to infinity here, or a law that is "
            "stiff beside the linear part, or try engine = cvode with method = bdf"};
}

}  // namespace dualdrive
