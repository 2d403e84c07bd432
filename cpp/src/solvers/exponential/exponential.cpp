#include "exponential.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "../../simulation/instant.hpp"
#include "dualdrive/machine.hpp"
#include "terms.hpp"

namespace dualdrive {

using exponential::backward, exponential::expand, exponential::gram_derivatives, exponential::last_gram,
    exponential::most_back, exponential::rescale, exponential::shift, exponential::terms;

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double shortest = 16.0 * std::numeric_limits<double>::epsilon();  // distance of nodes, of the time
constexpr double order = 9.0;     // the error of a step goes with this power of its length
constexpr double doubles = 1e-3;  // an error below which a step may be twice as long: 2⁻⁹, and half of that
constexpr int first_halvings = 6, after_switch = 2;  // of the grid: the first step; of a step: what a switch may leave
constexpr int after_a_bad_number = 2;                // halvings of a step that left the domain of the laws
// What a law makes of a motion in less time than this may hide between nodes: a few times that of a drive's own loops, and
// as long as BDF's steps are in smooth motion (benchmarks/laws.py).
constexpr double farthest = 8e-3;  // s
// Sweeps go on until what they leave, told by how they contract, is a small part of what a step may err by. A contraction
// that was not seen lately is believed less and less, and none is reckoned with that is better than `least_contraction`.
constexpr double enough = 0.1, least_contraction = 0.05, fades = 0.7;
constexpr double slow = 0.3;  // a contraction at which the step is too long
constexpr int most_sweeps = 8;
constexpr int worth_a_tangent = 16;  // steps that its propagators cost, measured
// A rest is none that adds so little to what a step may err by, or is rounding of the rate's largest term and of larger
// ones within the laws that cancel.
constexpr double negligible = 1e-4, rounding = 1024.0 * std::numeric_limits<double>::epsilon();
// What is rounding in the derivative by a law that the run does not show, of the whole rate.
constexpr double rounded_off = 1e-6;

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
      before_(states_, 0.0) {
    if (size.sensitivities > 0)
        forward_.reset(
            new Forward{{setup.machine, setup.inputs, setup.layout, generator_, setup.recorded, setup.parameters},
                        exponential::Sensitivities({problem, generator_, setup.grid, rtol, size.states, setup.scale}),
                        setup.start});
}

void Exponential::restart(double t, std::span<const double> atol, double quadrature_atol) {
    bring_sensitivities();
    t_ = begin_ = t;
    if (forward_) forward_->t = t;
    atol_.assign(atol.begin(), atol.end());
    quadrature_atol_ = quadrature_atol;
    now_ = nullptr;
    past_.clear();
    if (counts_.steps > 0 && setup_.modes != modes_)
        next_level_ = std::max(next_level_ - after_switch, -first_halvings);
    modes_ = setup_.modes;
    taken_ = false;
}

// What inputs do between nodes is known, and does not pass unseen, but for a formula that reads them.
void Exponential::limit_step(double longest, double turning) {
    const auto reads = [this](const EffectEntry& e) {
        const auto names = names_read(e);
        return std::any_of(setup_.inputs.begin(), setup_.inputs.end(), [&](const auto& input) {
            const auto is_it = [&](const std::string& name) {
                return name == input.first || name == "in." + input.first;
            };
            return std::any_of(names.begin(), names.end(), is_it);
        });
    };
    const auto& effects = setup_.machine.effects();
    const bool read = std::any_of(effects.begin(), effects.end(), reads);
    longest_ = std::min(longest, static_cast<double>(intervals) * (read ? std::min(turning, farthest) : farthest));
}

// ------------------------------------------------------------------------------------------- modes

// For the way back: rows that a law bends are driven however small it is.
void Exponential::drive_bent_rows() {
    std::vector<int> driven = setup_.steps->bent.in(setup_.modes, t_, z_.data());
    driven.insert(driven.end(), driven_.begin(), driven_.end());
    std::sort(driven.begin(), driven.end());
    driven.erase(std::unique(driven.begin(), driven.end()), driven.end());
    if (driven.size() == driven_.size()) return;
    driven_ = std::move(driven);
    known_.clear();
    past_.clear();
}

// The tangent in these modes, where they are met first; and a new one where sweeps alone have kept steps short, as seldom as
// what it costs. Other states may show more rows that the rest acts on.
// False where the laws have none.
bool Exponential::take_modes() {
    if (setup_.steps && !known_.contains(setup_.modes)) drive_bent_rows();
    auto& known = known_[setup_.modes];
    if (!known || known->held >= worth_a_tangent) {
        const exact::Laws<double> laws = reader_.tangent(setup_.modes, t_, z_.data());
        finite_ = laws.A.allFinite() && laws.guards.allFinite();
        if (!finite_) return false;
        auto tangent = std::make_shared<exponential::Tangent>(
            exponential::Tangent{setup_.modes, t_, z_, {laws.A, driven_, setup_.grid}});
        known.reset(new Frozen{std::move(tangent), {laws, driven_, setup_.grid}, 0, {}, nullptr});
        if (forward_) {
            exponential::SlopeReader::Slopes slopes = forward_->reader.read(setup_.modes, t_, z_.data());
            known->slopes =
                std::make_unique<exponential::SlopePropagators>(known->tangent->propagators, std::move(slopes.rates));
            known->outputs = std::move(slopes.outputs);
        }
        ++counts_.jacobians;
    }
    now_ = known.get();
    padded_ = static_cast<std::size_t>(exact::padded(static_cast<int>(driven_.size())));
    linear_.assign(rows(), 0.0);
    scratch_.assign(2 * rows(), 0.0);
    probe_.assign(width(), 0.0);
    kept_.assign(width(), 0.0);
    between_.assign(rows(), 0.0);
    yc_.assign(nodes * width(), 0.0);
    rest_.assign(nodes * padded_, 0.0);
    if (setup_.steps && setup_.steps->unseen.any()) unseen_.assign(nodes * padded_, 0.0);
    unseen_size_.resize(states_, 0.0);
    return true;
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
    if (setup_.steps && setup_.steps->unseen.any()) evaluate_unseen(node);
    finite_ = (work_.empty() || problem_.quadrature(t, y, powers_.data() + node * paths_)) &&
              (guard_count_ == 0 || problem_.guards(t, y, guards_.data() + node * guard_count_));
    return finite_;
}

// What laws would add to the rates there that the run does not show, and a gradient asks for.
void Exponential::evaluate_unseen(std::size_t node) {
    const auto& rates = setup_.steps->unseen.rates(node_time(node), column(node), modes_, setup_.cell);
    for (std::size_t r = 0; r < driven_.size(); ++r) {
        const auto row = static_cast<std::size_t>(driven_[r]);
        const double added = rates[row] - rate_[row];
        unseen_[node * padded_ + r] = added;
        unseen_size_[row] = std::max({unseen_size_[row], std::abs(added), rounded_off * std::abs(rate_[row])});
    }
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
    bring_sensitivities();
    taken_ = false;
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
        if (reach() <= least || (!now_ && !take_modes())) return Outcome::failed;
        more_driven_ = false;
        e = try_step(level);
        if (e <= 1.0) {
            end_ = end_before(stop);
            walk();
            look_for_suspects();
            e = std::max(e, defect_of_suspects());
            if (forward_ && e <= 1.0 && !more_driven_) e = std::max(e, sensitivities_over_step());
        }
        if (more_driven_) {
            known_.clear();
            now_ = nullptr;
            past_.clear();
            continue;
        }
        if (e <= 1.0) break;
        ++counts_.error_test_failures;
        level -= e < infinite ? std::max(1, static_cast<int>(std::ceil(std::log2(e) / order))) : after_a_bad_number;
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
    if (setup_.steps) write_step();
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
    return std::max({interpolation_error(), unseen_error(), work_error(), defect()});
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
                    sum +=
                        backward[p - 1][k][i] * (i <= j ? rest_[(j - i) * padded_ + r] : values[(i - j - 1) * m + r]);
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

Solver::Failure Exponential::failure() const {
    if (!finite_) return {false, not_finite};
    return {true,
            "the step size fell to nothing; look for a law or a motion that goes to infinity here, or a law that is "
            "stiff beside the linear part, or try engine = cvode with method = bdf"};
}

}  // namespace dualdrive
