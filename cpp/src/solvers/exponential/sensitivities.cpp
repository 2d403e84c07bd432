#include "sensitivities.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "../../simulation/instant.hpp"
#include "terms.hpp"

namespace dualdrive::exponential {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
// As of the step itself (exponential.cpp): sweeps go on until what they leave is a small part of what is allowed, and a
// contraction that is slow is that of a step which is too long.
constexpr double enough = 0.1, least_contraction = 0.05, slow = 0.3;
constexpr int most_sweeps = 8;
constexpr double negligible = 1e-4, rounding = 1024.0 * std::numeric_limits<double>::epsilon();
constexpr double bent = 1e-9;  // of the largest entry of A in a row: what ∂f/∂y is apart from it

}  // namespace

Sensitivities::Sensitivities(Setup setup)
    : setup_(std::move(setup)),
      parameters_(setup_.scale.size()),
      states_(static_cast<std::size_t>(setup_.states)),
      now_(parameters_ * states_, 0.0),
      weight_(parameters_ * states_),
      jacobian_(states_ * states_),
      rates_(parameters_ * states_),
      still_(states_, 0.0),
      no_slopes_(parameters_, still_.data()) {
    for (std::size_t k = 0; k < parameters_; ++k) rate_of_.push_back(rates_.data() + k * states_);
}

// ------------------------------------------------------------------------------------------- over a step

Sensitivities::Found Sensitivities::over(const Step& step, std::span<const double> atol) {
    open(step, atol);
    Found found;
    for (std::size_t j = 0; j < nodes; ++j)
        if (!linearise(j, found)) return {infinite, {}, false};
    if (!found.undriven.empty()) return found;
    give();
    drive();
    double moved = sweep();
    weigh();
    if (m_ == 0) return found;
    double contraction = 1.0;
    for (int k = 0; !(moved * std::max(contraction, least_contraction) <= enough); ++k) {
        drive();
        const double next = sweep();
        if (k == most_sweeps || !(next < infinite)) return {infinite, {}, true};
        contraction = next / moved;
        if (k > 0 && !(contraction < slow) && next > enough) return {infinite, {}, true};
        moved = next;
    }
    found.error = interpolation_error();
    return found;
}

void Sensitivities::open(const Step& step, std::span<const double> atol) {
    step_ = step;
    const Propagators& p = *step.propagators;
    atol_.assign(atol.begin(), atol.end());
    width_ = static_cast<std::size_t>(p.width());
    rows_ = static_cast<std::size_t>(p.rows());
    m_ = p.driven().size();
    lanes_ = static_cast<std::size_t>(exact::padded(static_cast<int>(parameters_ * m_)));
    delta_ = std::ldexp(setup_.grid, step.level);
    columns_.assign(nodes * parameters_ * width_, 0.0);
    bends_.assign(nodes * m_ * states_, 0.0);
    own_.assign(nodes * parameters_ * m_, 0.0);
    values_.assign(nodes * lanes_, 0.0);
    next_.assign(parameters_ * rows_, 0.0);
    linear_.assign(parameters_ * rows_, 0.0);
    for (std::size_t j = 0; j < nodes; ++j)
        for (std::size_t k = 0; k < parameters_; ++k)
            std::copy_n(now_.data() + k * states_, states_, column(j) + k * width_);
    at_.t = infinite;  // nothing known
    weigh();
}

// What errors of all are counted in: with the larger of both ends of the step.
void Sensitivities::weigh() {
    for (std::size_t k = 0; k < parameters_; ++k)
        for (std::size_t i = 0; i < states_; ++i) {
            const double size =
                std::max(std::abs(column(0)[k * width_ + i]), std::abs(column(intervals)[k * width_ + i]));
            weight_[k * states_ + i] = 1.0 / (atol_[i] / setup_.scale[k] + setup_.rtol * size);
        }
}

// ∂m/∂s and what m is without s at a node, by the model's own derivatives.
bool Sensitivities::linearise(std::size_t node, Found& found) {
    const Propagators& p = *step_->propagators;
    const double t = node_time(node);
    const double* const y = step_->columns + node * width_;
    if (!setup_.problem.jacobian(t, y, jacobian_.data()) ||
        !setup_.problem.sensitivity(t, y, no_slopes_.data(), rate_of_.data()))
        return false;
    std::fill(linear_.begin(), linear_.end(), 0.0);
    step_->slopes->add_rates(y, linear_.data(), rows_);
    for (std::size_t r = 0; r < m_; ++r) {
        const auto row = static_cast<std::size_t>(p.driven()[r]);
        for (std::size_t i = 0; i < states_; ++i)
            bends_[(node * m_ + r) * states_ + i] = jacobian_[i * states_ + row] - p.A()[i * rows_ + row];
        for (std::size_t k = 0; k < parameters_; ++k)
            own_[(node * parameters_ + k) * m_ + r] = rates_[k * states_ + row] - linear_[k * rows_ + row];
    }
    find_undriven(y, found);
    return true;
}

void Sensitivities::find_undriven(const double* y, Found& found) const {
    const Propagators& p = *step_->propagators;
    Vector terms_of(parameters_ * rows_, 0.0);
    step_->slopes->largest_terms(y, terms_of.data(), rows_);
    const auto acts_on = [&](std::size_t row) {
        double largest = 0.0, apart = 0.0;
        for (std::size_t i = 0; i < states_; ++i) {
            const double a = p.A()[i * rows_ + row], there = jacobian_[i * states_ + row];
            largest = std::max({largest, std::abs(a), std::abs(there)});
            apart = std::max(apart, std::abs(there - a));
        }
        if (apart > bent * largest) return true;
        for (std::size_t k = 0; k < parameters_; ++k) {
            const double rate = rates_[k * states_ + row], own = rate - linear_[k * rows_ + row];
            const double size = std::max(std::abs(rate), terms_of[k * rows_ + row]);
            if (std::abs(own) * delta_ * weight_[k * states_ + row] > negligible && std::abs(own) > rounding * size)
                return true;
        }
        return false;
    };
    for (std::size_t row = 0; row < states_; ++row) {
        const int number = static_cast<int>(row);
        const auto holds = [number](const std::vector<int>& rows) {
            return std::find(rows.begin(), rows.end(), number) != rows.end();
        };
        if (!holds(p.driven()) && !holds(found.undriven) && acts_on(row)) found.undriven.push_back(number);
    }
}

// What the states add to the sensitivities from node to node, whatever m is.
void Sensitivities::give() {
    given_.assign(intervals * parameters_ * rows_, 0.0);
    if (step_->slopes->none()) return;
    Moment at;
    for (std::size_t j = 0; j < intervals; ++j) {
        at.t = node_time(j);
        at.yc.assign(step_->columns + j * width_, step_->columns + (j + 1) * width_);
        at.columns.assign(parameters_ * width_, 0.0);
        march(at, node_time(j + 1));
        for (std::size_t k = 0; k < parameters_; ++k)
            std::copy_n(at.columns.data() + k * width_, rows_, given_.data() + (j * parameters_ + k) * rows_);
    }
}

// m at all nodes by the sensitivities there.
void Sensitivities::drive() {
    for (std::size_t j = 0; j < nodes; ++j)
        for (std::size_t k = 0; k < parameters_; ++k)
            for (std::size_t r = 0; r < m_; ++r) {
                const double *const bend = bends_.data() + (j * m_ + r) * states_, *const s = column(j) + k * width_;
                double sum = own_[(j * parameters_ + k) * m_ + r];
                for (std::size_t i = 0; i < states_; ++i) sum += bend[i] * s[i];
                values_[j * lanes_ + k * m_ + r] = sum;
            }
}

// The sensitivities at all nodes by the polynomial through m; returns how far they moved.
double Sensitivities::sweep() {
    if (m_ > 0) {
        expand(values_, static_cast<int>(lanes_), terms_);
        for (std::size_t j = 0; j < nodes; ++j)
            for (std::size_t order = 0; order < terms; ++order)
                for (std::size_t k = 0; k < parameters_; ++k)
                    std::copy_n(terms_.data() + (j * terms + order) * lanes_ + k * m_, m_,
                                column(j) + k * width_ + rows_ + order * m_);
    }
    const double* const M = step_->propagators->step(step_->level);
    double most = 0.0;
    for (std::size_t j = 0; j < intervals; ++j) {
        exact::kernels().product(static_cast<int>(rows_), static_cast<int>(width_), M, static_cast<int>(width_),
                                 column(j), static_cast<int>(parameters_), next_.data());
        const double* const given = given_.data() + j * parameters_ * rows_;
        moved_.assign(parameters_ * rows_, 0.0);
        for (std::size_t k = 0; k < parameters_; ++k)
            for (std::size_t i = 0; i < states_; ++i) {
                double& there = column(j + 1)[k * width_ + i];
                const double value = next_[k * rows_ + i] + given[k * rows_ + i];
                moved_[k * rows_ + i] = value - there;
                there = value;
            }
        most = std::max(most, farthest(moved_.data(), rows_));
    }
    return most;
}

// The largest of what is allowed, over all parameters.
double Sensitivities::farthest(const double* columns, std::size_t apart) const {
    double most = 0.0;
    for (std::size_t k = 0; k < parameters_; ++k) {
        double sum = 0.0;
        for (std::size_t i = 0; i < states_; ++i) {
            const double x = weight_[k * states_ + i] * columns[k * apart + i];
            sum += x * x;
        }
        if (!std::isfinite(sum)) return infinite;
        most = std::max(most, std::sqrt(sum / static_cast<double>(states_)));
    }
    return most;
}

// As that of a step's states (errors.cpp): what the last of the orthogonal polynomials, as far as m holds it, does.
double Sensitivities::interpolation_error() {
    const double* const M = step_->propagators->step(step_->level);
    Vector share(lanes_, 0.0), e(parameters_ * width_, 0.0);
    for (std::size_t i = 0; i < nodes; ++i)
        for (std::size_t l = 0; l < lanes_; ++l) share[l] += last_gram[i] * values_[i * lanes_ + l] / last_gram_square;
    double most = 0.0;
    for (std::size_t j = 0; j < intervals; ++j) {
        for (std::size_t k = 0; k < parameters_; ++k)
            for (std::size_t order = 0; order < terms; ++order)
                for (std::size_t r = 0; r < m_; ++r)
                    e[k * width_ + rows_ + order * m_ + r] = gram_derivatives[j][order] * share[k * m_ + r];
        exact::kernels().product(static_cast<int>(rows_), static_cast<int>(width_), M, static_cast<int>(width_),
                                 e.data(), static_cast<int>(parameters_), next_.data());
        for (std::size_t k = 0; k < parameters_; ++k)
            std::copy_n(next_.data() + k * rows_, rows_, e.data() + k * width_);
        most = std::max(most, farthest(next_.data(), rows_));
    }
    return most;
}

// ------------------------------------------------------------------------------------------- inside a step

void Sensitivities::bring(double t) {
    const double* const found = at(t);
    for (std::size_t k = 0; k < parameters_; ++k) std::copy_n(found + k * width_, states_, now_.data() + k * states_);
}

// From the node before, or from where one was looked at last if that is nearer.
const double* Sensitivities::at(double t) {
    const double places = std::clamp((t - step_->origin) / delta_ + 1e-9, 0.0, static_cast<double>(intervals));
    const auto node = static_cast<std::size_t>(places);
    if (!(at_.t <= t + rounding_of(t)) || at_.t < node_time(node) - rounding_of(t)) {
        at_.t = node_time(node);
        const double* const yc = step_->columns + node * width_;
        at_.yc.assign(yc, yc + width_);
        at_.columns.assign(column(node), column(node) + parameters_ * width_);
    }
    march(at_, t);
    return at_.columns.data();
}

void Sensitivities::march(Moment& at, double to) {
    if (!step_->slopes->none()) {
        const auto& knots = setup_.generator.knots();
        for (auto knot = std::upper_bound(knots.begin(), knots.end(), at.t + instant(at.t));
             knot != knots.end() && *knot <= to + instant(to); ++knot) {
            march_freely(at, *knot - at.t);
            setup_.generator.set(*knot, step_->cell, at.yc.data() + states_);
            at.t = *knot;
        }
    }
    march_freely(at, to - at.t);
    at.t = std::max(at.t, to);
}

// Over the halvings of the level that make up the time, and by a series over the rest.
void Sensitivities::march_freely(Moment& at, double length) {
    const double little = rounding_of(at.t + length);
    for (int level = step_->level; level >= step_->propagators->finest() && length > little; --level) {
        const double part = std::ldexp(setup_.grid, level);
        if (length < part - little) continue;
        apply(at, level);
        length -= part;
    }
    if (!(length > little)) return;
    const double share = length / delta_;
    const auto each_rest = [&](Moment& m, const auto& change) {
        change(m.yc.data() + rows_);
        for (std::size_t k = 0; k < parameters_; ++k) change(m.columns.data() + k * width_ + rows_);
    };
    Moment kept = at;
    each_rest(at, [&](double* c) { rescale(c, m_, share); });
    step_->slopes->taylor(length, at.yc.data(), at.columns.data(), static_cast<int>(parameters_));
    each_rest(kept, [&](double* c) { shift(c, m_, share); });
    std::copy_n(kept.yc.data() + rows_, terms * m_, at.yc.data() + rows_);
    for (std::size_t k = 0; k < parameters_; ++k)
        std::copy_n(kept.columns.data() + k * width_ + rows_, terms * m_, at.columns.data() + k * width_ + rows_);
}

// One step of a level.
void Sensitivities::apply(Moment& at, int level) {
    const double share = std::ldexp(1.0, level - step_->level);
    const double* const M = step_->propagators->step(level);
    const int rows = static_cast<int>(rows_), width = static_cast<int>(width_);
    scaled_ = at.columns;
    for (std::size_t k = 0; k < parameters_ && level < step_->level; ++k)
        rescale(scaled_.data() + k * width_ + rows_, m_, share);
    exact::kernels().product(rows, width, M, width, scaled_.data(), static_cast<int>(parameters_), next_.data());
    if (!step_->slopes->none()) {
        scaled_yc_ = at.yc;
        rescale(scaled_yc_.data() + rows_, m_, share);
        step_->slopes->add_step(level, scaled_yc_.data(), next_.data(), rows_);
        exact::kernels().multiply(rows, width, M, width, scaled_yc_.data(), 1, at.yc.data());
        shift(at.yc.data() + rows_, m_, share);
    }
    for (std::size_t k = 0; k < parameters_; ++k) {
        std::copy_n(next_.data() + k * rows_, rows_, at.columns.data() + k * width_);
        shift(at.columns.data() + k * width_ + rows_, m_, share);
    }
}

}  // namespace dualdrive::exponential
