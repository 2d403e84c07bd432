#include "adjoint.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "arithmetic.hpp"

namespace dualdrive::exact {

namespace {

using Real = Arithmetic<double>;

// The transpose of the upper n × columns part of a column-major matrix of `rows` rows.
std::vector<double> transpose(const std::vector<double>& M, int rows, int n, int columns) {
    const int stride = padded(columns);
    std::vector<double> T(static_cast<std::size_t>(stride * n), 0.0);
    for (int c = 0; c < columns; ++c)
        for (int r = 0; r < n; ++r)
            T[static_cast<std::size_t>(r * stride + c)] = M[static_cast<std::size_t>(c * rows + r)];
    return T;
}

Eigen::Map<const Matrix<double>, 0, Eigen::OuterStride<>> view(const std::vector<double>& M, int rows, int n,
                                                               int columns) {
    return {M.data(), n, columns, Eigen::OuterStride<>(rows)};
}

}  // namespace

OuterSum::OuterSum(int rows, int columns)
    : rows_(rows),
      columns_(columns),
      sum_(static_cast<std::size_t>(rows * columns), 0.0),
      left_(static_cast<std::size_t>(rows * most), 0.0),
      right_(static_cast<std::size_t>(columns * most), 0.0),
      product_(sum_.size()) {}

void OuterSum::add(const double* a, const double* b, double factor) {
    std::copy_n(a, rows_, left_.data() + pairs_ * rows_);
    for (int c = 0; c < columns_; ++c) right_[static_cast<std::size_t>(c * most + pairs_)] = factor * b[c];
    if (++pairs_ == most) flush();
}

void OuterSum::flush() {
    if (pairs_ == 0) return;
    Real::multiply(rows_, pairs_, left_.data(), most, right_.data(), columns_, product_.data());
    for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] += product_[i];
    pairs_ = 0;
}

const std::vector<double>& OuterSum::total() {
    flush();
    return sum_;
}

LawGradient::LawGradient(const Propagator<double>& law)
    : law_(law),
      n_(law.size()),
      rows_(law.rows()),
      signals_(static_cast<int>(law.laws().outputs.rows())),
      transposed_(levels + 1),
      exponential_(levels + 1),
      series_(rows_, n_),
      outputs_(rows_, signals_),
      A_transposed_(transpose(law.A(), rows_, n_, n_)),
      outputs_transposed_(transpose(law.output_rows(), law.outputs(), signals_, n_)),
      scratch_(static_cast<std::size_t>(rows_) * 2),
      last_(static_cast<std::size_t>(rows_)),
      guards_(Matrix<double>::Zero(law.laws().guards.rows(), n_)) {}

const std::vector<double>& LawGradient::transposed(int level) {
    auto& T = transposed_[static_cast<std::size_t>(level)];
    if (T.empty()) {
        T = transpose(law_.power(level), rows_, n_, n_);
        exponential_[static_cast<std::size_t>(level)] = OuterSum(rows_, n_);
    }
    return T;
}

void LawGradient::step_back(int level, const double* y, double* lambda) {
    const std::vector<double>& T = transposed(level);
    exponential_[static_cast<std::size_t>(level)].add(lambda, y);
    Real::multiply(rows_, n_, T.data(), rows_, lambda, 1, scratch_.data());
    std::copy_n(scratch_.data(), rows_, lambda);
}

// As Propagator::advance went: the halves it took, then the rest as a series, now the other way round.
void LawGradient::part_back(double length, const double* y, double* lambda) {
    std::vector<int> halves;
    std::vector<double> begins(y, y + rows_);
    const auto begin = [&](std::size_t k) { return begins.data() + k * static_cast<std::size_t>(rows_); };
    double part = law_.step();
    for (int b = 0; b <= levels && length > 0; ++b, part /= 2) {
        if (length < part) continue;
        begins.resize(begins.size() + static_cast<std::size_t>(rows_));
        Real::multiply(rows_, n_, law_.power(b).data(), rows_, begin(halves.size()), 1, begin(halves.size() + 1));
        halves.push_back(b);
        length -= part;
    }
    if (length > 0) taylor_back(length, begin(halves.size()), lambda);
    for (std::size_t k = halves.size(); k-- > 0;) step_back(halves[k], begin(k), lambda);
}

// y⁺ = Σ t_k, t_k = A t_{k−1} r/k. Backwards t̄_{k−1} = λ + Aᵀ t̄_k r/k, and A takes t̄_k t_{k−1}ᵀ r/k.
void LawGradient::taylor_back(double length, const double* y, double* lambda) {
    const int order = law_.order();
    std::vector<double> terms(static_cast<std::size_t>(rows_ * (order + 1)));
    std::copy_n(y, rows_, terms.data());
    for (int k = 1; k <= order; ++k) {
        double* t = terms.data() + k * rows_;
        Real::multiply(rows_, n_, law_.A().data(), rows_, t - rows_, 1, t);
        for (int i = 0; i < rows_; ++i) t[i] *= length / k;
    }
    std::copy_n(lambda, rows_, last_.data());  // t̄ of the last term
    for (int k = order; k > 0; --k) {
        series_.add(last_.data(), terms.data() + (k - 1) * rows_, length / k);
        Real::multiply(rows_, n_, A_transposed_.data(), rows_, last_.data(), 1, scratch_.data());
        for (int i = 0; i < rows_; ++i)
            last_[static_cast<std::size_t>(i)] = lambda[i] + scratch_[static_cast<std::size_t>(i)] * (length / k);
    }
    std::copy_n(last_.data(), rows_, lambda);
}

void LawGradient::outputs_back(int count, const double* y, const double* seeds, double* push) {
    Real::multiply(rows_, signals_, outputs_transposed_.data(), signals_, seeds, count, push);
    for (int k = 0; k < count; ++k) outputs_.add(y + k * rows_, seeds + k * signals_);
}

void LawGradient::guard_back(int guard, double weight, const double* y) {
    for (int j = 0; j < n_; ++j) guards_(guard, j) += weight * y[j];
}

// What the squarings and the series that led to the exponentials owe to A, backwards.
Matrix<double> LawGradient::of_exponentials() {
    Matrix<double> bar = Matrix<double>::Zero(n_, n_);  // ∂(cost)/∂E of the present level
    for (int b = 0; b <= levels; ++b) {
        if (b > 0) {
            const Matrix<double> root = view(law_.power(b), rows_, n_, n_);  // E_{b−1} = E_b E_b
            bar = (bar * root.transpose() + root.transpose() * bar).eval();
        }
        if (OuterSum& own = exponential_[static_cast<std::size_t>(b)]; !own.empty())
            bar += view(own.total(), rows_, n_, n_);
    }
    // E = 1 + F_1, F_k = (X + X F_{k+1})/k from F_{order+1} = 0 on.
    const double finest = law_.step() / (1 << levels);
    const Matrix<double> X = law_.laws().A * finest;
    std::vector<Matrix<double>> F(static_cast<std::size_t>(law_.order()) + 2, Matrix<double>::Zero(n_, n_));
    for (int k = law_.order(); k > 0; --k)
        F[static_cast<std::size_t>(k)] = (X + X * F[static_cast<std::size_t>(k) + 1]) / k;
    Matrix<double> owed = Matrix<double>::Zero(n_, n_);
    for (int k = 1; k <= law_.order(); ++k) {
        bar /= k;
        owed += bar + bar * F[static_cast<std::size_t>(k) + 1].transpose();
        bar = (X.transpose() * bar).eval();
    }
    return owed * finest;
}

void LawGradient::close() {
    closed_ = true;
    A_ = of_exponentials() + view(series_.total(), rows_, n_, n_);
}

double LawGradient::along(const Laws<double>& derivative) {
    if (!closed_) close();
    return A_.cwiseProduct(derivative.A).sum() + guards_.cwiseProduct(derivative.guards).sum() +
           view(outputs_.total(), rows_, n_, signals_).transpose().cwiseProduct(derivative.outputs).sum();
}

Adjoint::Adjoint(const Tape& tape, int states, std::function<void(int, double*)> jump_back)
    : tape_(tape), states_(states), jump_back_(std::move(jump_back)) {}

LawGradient& Adjoint::gradient(const Propagator<double>* law) {
    if (law != recent_) {
        recent_ = law;
        recent_gradient_ = &laws_.try_emplace(law, *law).first->second;
    }
    return *recent_gradient_;
}

// Outputs read from the state as a switch or a jump left it.
void Adjoint::present_outputs_back(Outputs outputs) {
    for (const Entry& e : outputs) {
        if (e.column >= 0) continue;
        gradient(e.law).outputs_back(1, values(e), seeds(e), side_.data());
        for (std::size_t i = 0; i < lambda_.size(); ++i) lambda_[i] += side_[i];
    }
}

// What the outputs along the steps add to λ at each column; those read between two columns go their own way back.
void Adjoint::pushes_of(Outputs outputs, const Entry& steps) {
    const int rows = steps.law->rows(), columns = steps.count + steps.column + 1;
    pushes_.assign(static_cast<std::size_t>(rows * columns), 0.0);
    for (const Entry& e : outputs) {
        if (e.column < 0) continue;
        LawGradient& g = gradient(e.law);
        const bool between = e.length > 0.0;
        side_.resize(std::max(side_.size(), static_cast<std::size_t>(rows * e.count)));
        const double* from = values(steps) + e.column * rows;
        g.outputs_back(e.count, between ? values(e) : from, seeds(e), side_.data());
        if (between) g.part_back(e.length, from, side_.data());
        double* push = pushes_.data() + e.column * rows;
        for (int i = 0; i < rows * e.count; ++i) push[i] += side_[static_cast<std::size_t>(i)];
    }
}

void Adjoint::steps_back(const Entry& entry, Outputs outputs) {
    pushes_of(outputs, entry);
    LawGradient& g = gradient(entry.law);
    const int rows = entry.law->rows();
    const double* y = values(entry);
    const auto push = [&](int column) {
        for (int i = 0; i < rows; ++i)
            lambda_[static_cast<std::size_t>(i)] += pushes_[static_cast<std::size_t>(column * rows + i)];
    };
    if (entry.column == 1) {
        push(entry.count + 1);
        g.part_back(entry.length, y + entry.count * rows, lambda_.data());
    }
    for (int k = entry.count; k > 0; --k) {
        push(k);
        g.step_back(0, y + (k - 1) * rows, lambda_.data());
    }
    push(0);
}

void Adjoint::switch_back(const Entry& e) {
    const double* y = values(e);
    switch (e.kind) {
        case Entry::Kind::shift:  // s⁺ = s⁻ + (f⁻ − f⁺) τ', a state set to zero having none
            for (int i = 0; i < states_; ++i) instant_ += y[i] * lambda_[static_cast<std::size_t>(i)];
            if (e.column >= 0) lambda_[static_cast<std::size_t>(e.column)] = 0.0;
            return;
        case Entry::Kind::instant: {  // τ' = −(g_z s + g_p) / ġ
            const double weight = -std::exchange(instant_, 0.0) / e.length;
            for (int i = 0; i < states_; ++i)
                lambda_[static_cast<std::size_t>(i)] += weight * e.law->laws().guards(e.count, i);
            return gradient(e.law).guard_back(e.count, weight, y);
        }
        case Entry::Kind::still:
            instant_ = 0.0;
            return;
        case Entry::Kind::jump:
            return jump_back_(e.count, lambda_.data());
        default:
            return;
    }
}

void Adjoint::walk(const double* seeds, std::size_t signals) {
    seeds_ = seeds;
    signals_ = signals;
    int rows = states_;
    for (const Entry& e : tape_.entries)
        if (e.law) rows = std::max(rows, e.law->rows());
    lambda_.assign(static_cast<std::size_t>(rows), 0.0);
    side_ = lambda_;
    std::size_t end = tape_.entries.size();  // of the outputs that follow the entry at hand
    for (std::size_t k = end; k-- > 0;) {
        const Entry& e = tape_.entries[k];
        if (e.kind == Entry::Kind::outputs) continue;
        const Outputs outputs(tape_.entries.data() + k + 1, end - k - 1);
        present_outputs_back(outputs);
        if (e.kind == Entry::Kind::steps)
            steps_back(e, outputs);
        else
            switch_back(e);
        end = k;
    }
    present_outputs_back({tape_.entries.data(), end});
}

}  // namespace dualdrive::exact
