#include "slopes.hpp"

#include <algorithm>

#include "arithmetic.hpp"

namespace dualdrive::exact {

namespace {

using Real = Arithmetic<double>;

}  // namespace

SlopePropagator::Rows SlopePropagator::compress(const std::vector<const Matrix<double>*>& matrices, int stride) {
    Rows r;
    std::vector<std::pair<const Matrix<double>*, Eigen::Index>> kept;
    for (std::size_t j = 0; j < matrices.size(); ++j)
        for (Eigen::Index i = 0; i < matrices[j]->rows(); ++i)
            if (matrices[j]->row(i).any()) {
                kept.emplace_back(matrices[j], i);
                r.target.push_back(static_cast<int>(j) * stride + static_cast<int>(i));
            }
    if (kept.empty()) return r;
    r.rows = padded(static_cast<int>(kept.size()));
    r.matrix.assign(static_cast<std::size_t>(r.rows) * static_cast<std::size_t>(matrices.front()->cols()), 0.0);
    for (std::size_t k = 0; k < kept.size(); ++k)
        for (Eigen::Index c = 0; c < kept[k].first->cols(); ++c)
            r.matrix[static_cast<std::size_t>(c) * static_cast<std::size_t>(r.rows) + k] =
                (*kept[k].first)(kept[k].second, c);
    return r;
}

void SlopePropagator::Rows::add_product(int n, const double* x, double factor, double* out,
                                        std::vector<double>& scratch) const {
    if (rows == 0) return;
    scratch.resize(static_cast<std::size_t>(rows));
    Real::multiply(rows, n, matrix.data(), n, x, 1, scratch.data());
    for (std::size_t k = 0; k < target.size(); ++k) out[target[k]] += factor * scratch[k];
}

SlopePropagator::SlopePropagator(const Propagator<double>& propagator, const std::vector<Laws<double>>& derivatives)
    : propagator_(propagator),
      parameters_(static_cast<int>(derivatives.size())),
      n_(propagator.size()),
      rows_(propagator.rows()) {
    std::vector<const Matrix<double>*> rates, outputs;
    for (const auto& d : derivatives) {
        rates.push_back(&d.A);
        outputs.push_back(&d.outputs);
        guards_.push_back(d.guards);
    }
    A_ = compress(rates, rows_);
    outputs_ = compress(outputs, static_cast<int>(derivatives.empty() ? 0 : derivatives.front().outputs.rows()));

    const auto matrix = static_cast<std::size_t>(rows_) * static_cast<std::size_t>(n_);
    const auto all = static_cast<std::size_t>(parameters_) * static_cast<std::size_t>(rows_);
    product_.resize(all);
    term_.resize(all);
    next_.resize(all);
    y_term_.resize(static_cast<std::size_t>(rows_));
    y_next_.resize(static_cast<std::size_t>(rows_));
    power_.assign(levels + 1, std::vector<double>(all * static_cast<std::size_t>(n_)));
    const double finest = propagator.step() / (1 << levels);
    std::vector<double> X = propagator.A(), F(matrix, 0.0), L(matrix), one(matrix), other(matrix);
    for (double& x : X) x *= finest;
    for (int j = 0; j < parameters_; ++j) {
        std::vector<double> dX(matrix, 0.0);
        const Matrix<double>& dA = derivatives[static_cast<std::size_t>(j)].A;
        for (Eigen::Index c = 0; c < n_; ++c)
            for (Eigen::Index r = 0; r < n_; ++r) dX[static_cast<std::size_t>(c * rows_ + r)] = dA(r, c) * finest;
        // Horner's rule of the exponential, F ← (X + X F)/k, and its derivative beside it.
        std::fill(F.begin(), F.end(), 0.0);
        std::fill(L.begin(), L.end(), 0.0);
        for (int k = propagator.order(); k > 0; --k) {
            Real::multiply(rows_, n_, dX.data(), rows_, F.data(), n_, one.data());
            Real::multiply(rows_, n_, X.data(), rows_, L.data(), n_, other.data());
            for (std::size_t i = 0; i < matrix; ++i) L[i] = (dX[i] + one[i] + other[i]) / k;
            Real::multiply(rows_, n_, X.data(), rows_, F.data(), n_, one.data());
            for (std::size_t i = 0; i < matrix; ++i) F[i] = (X[i] + one[i]) / k;
        }
        for (int b = levels; b >= 0; --b) {
            if (b < levels) {  // d(E E) = dE E + E dE
                const double* E = propagator.power(b + 1).data();
                Real::multiply(rows_, n_, L.data(), rows_, E, n_, one.data());
                Real::multiply(rows_, n_, E, rows_, L.data(), n_, other.data());
                for (std::size_t i = 0; i < matrix; ++i) L[i] = one[i] + other[i];
            }
            for (int c = 0; c < n_; ++c)
                std::copy_n(L.data() + c * rows_, rows_,
                            power_[static_cast<std::size_t>(b)].data() + static_cast<std::size_t>(c) * all +
                                static_cast<std::size_t>(j * rows_));
        }
    }
}

void SlopePropagator::step(int level, const double* y, double* S) {
    const int all = parameters_ * rows_;
    Real::multiply(all, n_, power_[static_cast<std::size_t>(level)].data(), rows_, y, 1, next_.data());
    Real::multiply(rows_, n_, propagator_.power(level).data(), rows_, S, parameters_, product_.data());
    for (int i = 0; i < all; ++i) S[i] = product_[static_cast<std::size_t>(i)] + next_[static_cast<std::size_t>(i)];
}

void SlopePropagator::advance(double length, double* y, double* S) {
    double part = propagator_.step();
    for (int b = 0; b <= levels && length > 0; ++b, part /= 2) {
        if (length < part) continue;
        step(b, y, S);
        Real::multiply(rows_, n_, propagator_.power(b).data(), rows_, y, 1, y_next_.data());
        std::copy(y_next_.begin(), y_next_.end(), y);
        length -= part;
    }
    if (length > 0) taylor(length, y, S);
}

// The terms of e^{A r} y and of its derivative together: t_k = A t_{k−1} r/k, s_k = (A s_{k−1} + ∂A t_{k−1}) r/k.
void SlopePropagator::taylor(double length, double* y, double* S) {
    const int all = parameters_ * rows_;
    std::copy_n(S, all, term_.begin());
    std::copy_n(y, rows_, y_term_.begin());
    for (int k = 1; k <= propagator_.order(); ++k) {
        const double factor = length / k;
        Real::multiply(rows_, n_, propagator_.A().data(), rows_, term_.data(), parameters_, next_.data());
        A_.add_product(n_, y_term_.data(), 1.0, next_.data(), scratch_);
        Real::multiply(rows_, n_, propagator_.A().data(), rows_, y_term_.data(), 1, y_next_.data());
        for (int i = 0; i < all; ++i) S[i] += next_[static_cast<std::size_t>(i)] *= factor;
        for (int i = 0; i < rows_; ++i) y[i] += y_next_[static_cast<std::size_t>(i)] *= factor;
        term_.swap(next_);
        y_term_.swap(y_next_);
    }
}

void SlopePropagator::guard(int guard, const double* y, const double* S, double* slopes) const {
    using Vector = Eigen::Map<const Eigen::VectorXd>;
    const Eigen::RowVectorXd row = propagator_.laws().guards.row(guard);
    for (int j = 0; j < parameters_; ++j)
        slopes[j] =
            row.dot(Vector(S + j * rows_, n_)) + guards_[static_cast<std::size_t>(j)].row(guard).dot(Vector(y, n_));
}

void SlopePropagator::signals(const double* y, const double* S, int count, double* slopes) {
    const int m = propagator_.outputs();
    next_.resize(std::max(next_.size(), static_cast<std::size_t>(m * parameters_)));
    Real::multiply(m, n_, propagator_.output_rows().data(), rows_, S, parameters_, next_.data());
    std::vector<double>& own = term_;  // ∂C/∂p y, parameter by parameter
    own.resize(std::max(own.size(), static_cast<std::size_t>(count * parameters_)));
    std::fill_n(own.begin(), count * parameters_, 0.0);
    outputs_.add_product(n_, y, 1.0, own.data(), scratch_);
    for (int s = 0; s < count; ++s)
        for (int j = 0; j < parameters_; ++j)
            slopes[s * parameters_ + j] =
                next_[static_cast<std::size_t>(j * m + s)] + own[static_cast<std::size_t>(j * count + s)];
}

}  // namespace dualdrive::exact
