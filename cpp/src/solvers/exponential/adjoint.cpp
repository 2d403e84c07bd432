#include "adjoint.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "../../simulation/instant.hpp"
#include "terms.hpp"

namespace dualdrive::exponential {

namespace {

// Sweeps contract at least as those of the step did, by slow = 0.3; they go on to rounding.
constexpr int most_sweeps = 60;
constexpr double settled = 1e-13;

// through_nodes, transposed: a column for each node's value, over all nodes' derivatives.
constexpr auto onto_nodes = [] {
    std::array<std::array<double, nodes * terms>, nodes> w{};
    for (std::size_t j = 0; j < nodes; ++j)
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t i = 0; i < nodes; ++i) w[i][j * terms + k] = through_nodes[j][k][i];
    return w;
}();

}  // namespace

Adjoint::Adjoint(const Tape& tape, int states, std::function<void(int, double*)> jump_back, Setup setup)
    : dualdrive::Adjoint(tape, states, std::move(jump_back)), setup_(std::move(setup)), rates_(nodes) {}

// ------------------------------------------------------------------------------------------- outputs and guards

// The results that were weighed, back to the states from number `first` on.
void Adjoint::add_owed(std::size_t first, double* lambda) {
    TracedParameters& parameters = setup_.pullback.parameters();
    parameters.walk_back();
    for (int i = 0; i < states_; ++i) lambda[i] += parameters.owed(first + static_cast<std::size_t>(i));
}

void Adjoint::output_back(const Entry& e, double* lambda) {
    const Place& at = setup_.places[static_cast<std::size_t>(e.place)];
    Pullback& pullback = setup_.pullback;
    pullback.parameters().begin();
    const std::size_t first = pullback.evaluate(at, true);
    for (std::size_t s = 0; s < setup_.recorded.size(); ++s)
        pullback.parameters().weigh(pullback.model().signals()[static_cast<std::size_t>(setup_.recorded[s])],
                                    seeds(e)[s]);
    add_owed(first, lambda);
}

// The same within a step where signals are C y: λ += Cᵀ seeds, and C owes seeds yᵀ.
void Adjoint::affine_output_back(const Entry& e, double* lambda) {
    const Place& at = setup_.places[static_cast<std::size_t>(e.place)];
    const exact::Matrix<double>& C = known_->outputs;
    y_.assign(static_cast<std::size_t>(C.cols()), 1.0);
    std::copy(at.z.begin(), at.z.end(), y_.begin());
    setup_.generator.set(at.t, at.cell, y_.data() + states_);
    for (Eigen::Index j = 0; j < C.cols(); ++j)
        for (Eigen::Index s = 0; s < C.rows(); ++s) {
            if (j < states_) lambda[j] += C(s, j) * seeds(e)[s];
            known_->outputs_owed(s, j) += seeds(e)[s] * y_[static_cast<std::size_t>(j)];
        }
}

void Adjoint::present_output_back(const Entry& e) { output_back(e, lambda_.data()); }

void Adjoint::guard_back(const Entry& e, double weight) {
    Pullback& pullback = setup_.pullback;
    pullback.parameters().begin();
    const std::size_t first = pullback.evaluate(setup_.places[static_cast<std::size_t>(e.place)]);
    pullback.parameters().weigh(
        pullback.model().guard(e.count / guards_per_switch, e.count % guards_per_switch, nullptr), weight);
    add_owed(first, lambda_.data());
}

// ------------------------------------------------------------------------------------------- a step

void Adjoint::steps_back(const Entry& entry, Outputs outputs) {
    open(entry);
    arrive(step_->end, lambda_.data());
    for (std::size_t k = outputs.size(); k-- > 0;) {
        const Entry& e = outputs[k];
        if (e.column < 0) continue;
        std::fill(lambda_.begin(), lambda_.end(), 0.0);
        if (known_->outputs.size() > 0)
            affine_output_back(e, lambda_.data());
        else
            output_back(e, lambda_.data());
        arrive(setup_.places[static_cast<std::size_t>(e.place)].t, lambda_.data());
    }
    arrivals_back();
    linearise();
    solve();
    keep();
    std::copy_n(owed_at(0), lambda_rows_, lambda_.begin());
}

Adjoint::Known& Adjoint::known(const std::shared_ptr<Tangent>& tangent) {
    for (const auto& each : tangents_)
        if (each->tangent == tangent) return *each;
    exact::Matrix<double> outputs = setup_.outputs(*tangent);
    const exact::Matrix<double> nothing = exact::Matrix<double>::Zero(outputs.rows(), outputs.cols());
    tangents_.push_back(std::make_unique<Known>(
        Known{tangent, TangentGradient(tangent->propagators, states_), std::move(outputs), nothing}));
    return *tangents_.back();
}

// Its states at the nodes, and there the derivatives of the rest's polynomial.
void Adjoint::open(const Entry& entry) {
    step_ = &setup_.taken[static_cast<std::size_t>(entry.count)];
    known_ = &known(step_->tangent);
    gradient_ = &known_->gradient;
    propagators_ = &step_->tangent->propagators;
    width_ = static_cast<std::size_t>(propagators_->width());
    tall_ = static_cast<std::size_t>(gradient_->tall());
    const std::size_t m = propagators_->driven().size(), rows = static_cast<std::size_t>(propagators_->rows());
    rest_width_ = static_cast<std::size_t>(exact::padded(static_cast<int>(m)));
    yc_.assign(nodes * width_, 0.0);
    for (std::size_t j = 0; j < nodes; ++j)
        std::copy_n(values(entry) + j * rows, rows, yc_.begin() + static_cast<std::ptrdiff_t>(j * width_));
    if (m > 0) {
        const double* const rest = values(entry) + nodes * rows;
        values_.assign(rest, rest + nodes * rest_width_);
        expand(values_, static_cast<int>(rest_width_), all_terms_);
        for (std::size_t k = 0; k < nodes * terms; ++k)
            std::copy_n(all_terms_.data() + k * rest_width_, m, yc_.data() + k / terms * width_ + rows + k % terms * m);
    }
    for (std::size_t j = 0; j < intervals; ++j) knotted_[j] = knotted(j);
    within_.assign(nodes * tall_, 0.0);
    owed_.assign(nodes * tall_, 0.0);
    rest_.assign(nodes * rest_width_, 0.0);
    part_.resize(tall_);
    arrivals_.clear();
}

// λ that comes in at a node, or between two.
void Adjoint::arrive(double t, const double* lambda) {
    const double places = std::clamp((t - step_->origin) / step_->delta, 0.0, static_cast<double>(intervals));
    const auto node = static_cast<std::size_t>(places + 1e-9);
    if (node == intervals || t - node_time(node) <= rounding_of(t))
        for (int i = 0; i < lambda_rows_; ++i) within_[node * tall_ + static_cast<std::size_t>(i)] += lambda[i];
    else
        arrivals_.push_back({node, t, {lambda, lambda + lambda_rows_}});
}

// ∂n/∂y at all nodes; the rates stay on the trace.
void Adjoint::linearise() {
    const auto& driven = propagators_->driven();
    const std::size_t m = driven.size(), n = static_cast<std::size_t>(states_);
    const auto rows = static_cast<std::size_t>(propagators_->rows());
    Pullback& pullback = setup_.pullback;
    pullback.parameters().begin();
    slopes_.resize(nodes * m * n);
    if (m == 0) return;
    for (std::size_t j = 0; j < nodes; ++j) {
        const std::size_t first = pullback.evaluate(node_time(j), column(j), step_->tangent->modes, step_->cell);
        rates_[j].clear();
        for (const int row : driven) rates_[j].push_back(pullback.model().rate()[static_cast<std::size_t>(row)]);
        double* const slopes = slopes_.data() + j * m * n;
        pullback.slopes(first, rates_[j], slopes);
        for (std::size_t r = 0; r < m; ++r)
            for (std::size_t i = 0; i < n; ++i)
                slopes[r * n + i] -= propagators_->A()[i * rows + static_cast<std::size_t>(driven[r])];
    }
}

void Adjoint::solve() {
    for (int k = 0; k < most_sweeps && sweep() > settled; ++k) continue;
}

// All v and c̄ by the n̄ at hand, and n̄ by these; returns how far n̄ moved.
double Adjoint::sweep() {
    const std::size_t m = propagators_->driven().size(), n = static_cast<std::size_t>(states_);
    const auto c = static_cast<std::size_t>(gradient_->owed_to_rest());
    for (std::size_t j = nodes; j-- > 0;) {
        double* const owed = owed_at(j);
        if (j < intervals) interval_back(j, owed_at(j + 1), false, owed);
        for (std::size_t i = 0; i < tall_; ++i) owed[i] = (j < intervals ? owed[i] : 0.0) + within_[j * tall_ + i];
        for (std::size_t r = 0; r < m; ++r)
            for (std::size_t i = 0; i < n; ++i) owed[i] += slopes_[(j * m + r) * n + i] * rest_[j * rest_width_ + r];
    }
    if (m == 0) return 0.0;
    terms_.assign(nodes * terms * rest_width_, 0.0);
    for (std::size_t k = 0; k < nodes * terms; ++k)
        std::copy_n(owed_at(k / terms) + c + k % terms * m, m, terms_.data() + k * rest_width_);
    next_.resize(rest_.size());
    exact::kernels().product(static_cast<int>(rest_width_), static_cast<int>(nodes * terms), terms_.data(),
                             static_cast<int>(nodes * terms), onto_nodes[0].data(), static_cast<int>(nodes),
                             next_.data());
    double most = 0.0;
    for (std::size_t r = 0; r < m; ++r) {
        double size = 0.0, moved = 0.0;
        for (std::size_t j = 0; j < nodes; ++j) {
            size = std::max(size, std::abs(next_[j * rest_width_ + r]));
            moved = std::max(moved, std::abs(next_[j * rest_width_ + r] - rest_[j * rest_width_ + r]));
        }
        if (size > 0.0) most = std::max(most, moved / size);
    }
    rest_.swap(next_);
    return most;
}

// What the step owes to its propagators and, by its rates, to parameters.
void Adjoint::keep() {
    const std::size_t m = propagators_->driven().size();
    Vector lambda(intervals * static_cast<std::size_t>(lambda_rows_));
    for (std::size_t j = 0; j < intervals; ++j)
        std::copy_n(owed_at(j + 1), lambda_rows_, lambda.begin() + static_cast<std::ptrdiff_t>(j) * lambda_rows_);
    for (std::size_t j = 0; j < intervals;) {
        if (knotted_[j]) {
            interval_back(j, owed_at(j + 1), true, part_.data());
            ++j;
            continue;
        }
        std::size_t last = j + 1;
        while (last < intervals && !knotted_[last]) ++last;
        gradient_->keep(step_->level, static_cast<int>(last - j), column(j),
                        lambda.data() + j * static_cast<std::size_t>(lambda_rows_));
        j = last;
    }
    if (m == 0) return;
    Vector rest(nodes * m);
    for (std::size_t j = 0; j < nodes; ++j) std::copy_n(rest_.data() + j * rest_width_, m, rest.data() + j * m);
    gradient_->keep_rest(static_cast<int>(nodes), column(0), rest.data());
    for (std::size_t j = 0; j < nodes; ++j)
        for (std::size_t r = 0; r < m; ++r) setup_.pullback.parameters().weigh(rates_[j][r], rest[j * m + r]);
    setup_.pullback.parameters().walk_back();
}

}  // namespace dualdrive::exponential
