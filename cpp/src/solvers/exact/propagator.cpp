#include "propagator.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "arithmetic.hpp"
#include "crossing.hpp"

namespace dualdrive::exact {

namespace {

constexpr double widest = 3.0;  // of ‖A‖ h: beyond it more halvings cost less than more terms
constexpr int most_halvings = 48;
// max of |∏ (t − nodes)| / 6! h⁻⁶ for two triple nodes: (1/2)⁶ / 720
constexpr double hermite_error = 1.0 / 46080.0;
constexpr int bound_nodes = 8;
constexpr double rounding = 16.0;  // units in the last place of the largest term

}  // namespace

// A bound on the spectral radius of |A|, whatever the units of the states: max √(row sum · column sum) (A. Ostrowski,
// 1951) after balancing by powers of two. Entries that only drive or are only driven have no part in it.
template <class R>
R spectral_bound(const Matrix<R>& A) {
    Matrix<R> B = A.cwiseAbs();
    B.diagonal().setZero();
    for (bool again = true; again;) {
        again = false;
        for (Eigen::Index i = 0; i < B.rows(); ++i) {
            const bool drives = B.col(i).any(), driven = B.row(i).any();
            if (drives == driven) continue;
            B.row(i).setZero();
            B.col(i).setZero();
            again = true;
        }
    }
    for (int sweep = 0; sweep < 6; ++sweep)
        for (Eigen::Index i = 0; i < B.rows(); ++i) {
            const R row = B.row(i).sum(), column = B.col(i).sum();
            if (!(row > 0)) continue;
            const R f = std::exp2(std::round(std::log2(row / column) / 2));
            B.row(i) /= f;
            B.col(i) *= f;
        }
    B.diagonal() = A.diagonal().cwiseAbs();
    R bound(0);
    for (Eigen::Index i = 0; i < B.rows(); ++i) bound = std::max(bound, std::sqrt(B.row(i).sum() * B.col(i).sum()));
    return bound;
}

// Terms until θ^k / k! is lost in rounding, and some more for what chains of integrators put in front of it.
template <class R>
int terms_for(R theta) {
    R term(1);
    int k = 0;
    while (k < 200 && (term > std::numeric_limits<R>::epsilon() / 32 || R(k) < theta)) term *= theta / R(++k);
    return k + 4;
}

template <class R>
std::vector<R> Propagator<R>::pack(const Matrix<R>& m, int rows) const {
    std::vector<R> packed(static_cast<std::size_t>(rows) * static_cast<std::size_t>(m.cols()), R(0));
    for (Eigen::Index j = 0; j < m.cols(); ++j)
        for (Eigen::Index i = 0; i < m.rows(); ++i) packed[static_cast<std::size_t>(j * rows + i)] = m(i, j);
    return packed;
}

template <class R>
Propagator<R>::Propagator(Laws<R> laws, double grid)
    : laws_(std::move(laws)), n_(static_cast<int>(laws_.A.rows())), rows_(padded(n_)), step_(grid) {
    if (!laws_.A.allFinite() || !laws_.guards.allFinite())
        throw std::domain_error("a coefficient of the linear equations is not finite");
    const R norm = spectral_bound<R>(laws_.A);
    while (norm * R(step_) > R(widest) && halvings_ < most_halvings) {
        step_ /= 2;
        ++halvings_;
    }
    A_ = pack(laws_.A, rows_);
    exponentials(norm);
    terms_ = std::min(most_terms, terms_for<R>(norm * R(step_)) + 1);
    find_watched();
    find_bounds();
    outputs_rows_ = padded(static_cast<int>(laws_.outputs.rows()));
    outputs_ = pack(laws_.outputs, outputs_rows_);
}

// F = e^X − 1, and from it F ← 2 F + F² for twice the time: the ones on the diagonal, in which the digits of a small F
// would drown, are added last.
template <class R>
void Propagator<R>::exponentials(R norm) {
    const R finest = R(step_) / R(1 << levels);
    order_ = terms_for<R>(norm * finest);
    const auto size = static_cast<std::size_t>(rows_) * static_cast<std::size_t>(n_);
    const auto times = [&](const std::vector<R>& a, const std::vector<R>& b) {
        std::vector<R> product(size);
        Arithmetic<R>::multiply(rows_, n_, a.data(), rows_, b.data(), n_, product.data());
        return product;
    };
    std::vector<R> X = A_;
    for (R& x : X) x *= finest;
    std::vector<R> F(size, R(0));
    for (int k = order_; k > 0; --k) {  // Horner's rule: F ← (X + X F) / k
        F = times(X, F);
        for (std::size_t i = 0; i < size; ++i) F[i] = (F[i] + X[i]) / R(k);
    }
    power_.assign(levels + 1, {});
    for (int b = levels; b >= 0; --b) {
        if (b < levels) {
            const std::vector<R> square = times(F, F);
            for (std::size_t i = 0; i < size; ++i) F[i] += F[i] + square[i];
        }
        power_[static_cast<std::size_t>(b)] = F;
        for (int i = 0; i < n_; ++i)
            power_[static_cast<std::size_t>(b)][static_cast<std::size_t>(i * rows_ + i)] += R(1);
    }
}

template <class R>
std::vector<Watched<R>> watched_quantities(const Matrix<R>& G) {
    std::vector<Watched<R>> watched;
    const Eigen::Index one = G.cols() - 1;
    const auto constant = [&](Eigen::Index g) { return G.row(g).head(one).isZero(0); };
    for (Eigen::Index g = 0; g < G.rows(); ++g) {
        if (constant(g) && G(g, one) > R(0)) continue;  // an unused guard never falls
        const bool pair = g % guards_per_switch == 0 && g + 1 < G.rows() &&
                          (G.row(g).head(one) + G.row(g + 1).head(one)).isZero(0) && !constant(g);
        if (pair) {
            watched.push_back({static_cast<int>(g), static_cast<int>(g) + 1, G(g, one) + G(g + 1, one)});
            ++g;
        } else {
            watched.push_back({static_cast<int>(g), -1, std::numeric_limits<R>::infinity()});
        }
    }
    return watched;
}

template <class R>
void Propagator<R>::find_watched() {
    const Matrix<R>& G = laws_.guards;
    const Eigen::Index one = n_ - 1;
    watched_ = watched_quantities<R>(G);
    const int m = watch_rows();
    watched_rows_.resize(static_cast<Eigen::Index>(watched_.size()), n_);
    Matrix<R> all = Matrix<R>::Zero(3 * m, n_);
    for (std::size_t k = 0; k < watched_.size(); ++k)
        watched_rows_.row(static_cast<Eigen::Index>(k)) = G.row(watched_[k].low);
    const R h(step_);
    const auto count = static_cast<Eigen::Index>(watched_.size());
    const Matrix<R> first = watched_rows_ * laws_.A, second = first * laws_.A;
    all.topRows(count) = watched_rows_;
    all.middleRows(m, count) = first * (h / 5);
    all.middleRows(2 * m, count) = second * (h * h / 20);
    for (Eigen::Index k = count; k < m; ++k) all(k, one) = R(1);  // what fills the lane is always valid
    watch_ = pack(all, 3 * m);
    upper_.assign(static_cast<std::size_t>(m), std::numeric_limits<R>::infinity());
    for (std::size_t k = 0; k < watched_.size(); ++k) upper_[k] = watched_[k].upper;
}

// |q⁽⁶⁾(t + s)| = |G A⁶ e^{A s} y(t)| ≤ Σ_j w_j |y_j| for all s in the step, with w_j ≥ max_s |(G A⁶ e^{A s})_j|. The maximum
// is taken at the middles of `bound_nodes` parts and carried to their ends by |v e^{A δ}| ≤ |v| e^{|A| δ}.
template <class R>
void Propagator<R>::find_bounds() {
    const int m = watch_rows(), count = static_cast<int>(watched_.size());
    bounds_.assign(static_cast<std::size_t>(2 * m * n_), R(0));
    if (count == 0) return;
    // Rows stand as columns: v A is A' v.
    const auto times = [&](const std::vector<R>& transposed, const std::vector<R>& v) {
        std::vector<R> product(v.size());
        Arithmetic<R>::multiply(rows_, n_, transposed.data(), rows_, v.data(), count, product.data());
        return product;
    };
    const auto size = [](std::vector<R> v) {
        for (R& x : v) x = std::abs(x);
        return v;
    };
    std::vector<R> A = transposed(rows_, n_, A_);
    const std::vector<R> value = pack(watched_rows_.transpose(), rows_), slope = times(A, value),
                         curvature = times(A, slope);
    std::vector<R> v = curvature;
    for (int k = 2; k < 6; ++k) v = times(A, v);
    v = times(transposed(rows_, n_, power(4)), v);
    std::vector<R> worst = size(v);
    const std::vector<R> on = transposed(rows_, n_, power(3));
    for (int k = 1; k < bound_nodes; ++k) {
        v = times(on, v);
        for (std::size_t i = 0; i < v.size(); ++i) worst[i] = std::max(worst[i], std::abs(v[i]));
    }
    for (R& x : A) x = std::abs(x) * R(step_) / R(2 * bound_nodes);
    std::vector<R> term = worst;
    for (int k = 1; k <= order_ + 2; ++k) {
        term = times(A, term);
        for (std::size_t i = 0; i < term.size(); ++i) worst[i] += term[i] /= R(k);
    }
    // What rounding leaves of the first terms of q's series, where large torques may cancel.
    const R h(step_), bound = R(1.001) * R(hermite_error) * std::pow(h, 6);
    const R noise = R(rounding) * std::numeric_limits<R>::epsilon();
    for (int i = 0; i < count; ++i)
        for (int j = 0; j < n_; ++j) {
            const auto from = static_cast<std::size_t>(i * rows_ + j), to = static_cast<std::size_t>(j * 2 * m + i);
            bounds_[to] = bound * worst[from];
            bounds_[to + static_cast<std::size_t>(m)] =
                noise * (std::abs(value[from]) + std::abs(slope[from]) * h + std::abs(curvature[from]) * h * h / 2);
        }
}

template <class R>
R Propagator<R>::bound_beside(std::size_t watched, const R* y, const R* y0, R error) const {
    const int stride = 2 * watch_rows();
    for (int j = 0; j < n_; ++j)
        error += bounds_[watched + static_cast<std::size_t>(j * stride)] * std::abs(y[j] - y0[j]);
    return error;
}

template <class R>
const std::vector<R>& Propagator<R>::series(std::size_t watched) const {
    if (series_.empty()) find_series();
    return series_[watched];
}

// Rows q, q A h, q A² h²/2, ... of all watched quantities at once, as columns.
template <class R>
void Propagator<R>::find_series() const {
    const auto count = static_cast<int>(watched_.size());
    const int terms = padded(terms_);
    series_.assign(watched_.size(), std::vector<R>(static_cast<std::size_t>(terms * n_), R(0)));
    const std::vector<R> A = transposed(rows_, n_, A_);
    std::vector<R> row = pack(watched_rows_.transpose(), rows_), next(row.size());
    for (int k = 0; k < terms_; ++k) {
        for (int i = 0; i < count; ++i)
            for (int j = 0; j < n_; ++j)
                series_[static_cast<std::size_t>(i)][static_cast<std::size_t>(j * terms + k)] =
                    row[static_cast<std::size_t>(i * rows_ + j)];
        Arithmetic<R>::multiply(rows_, n_, A.data(), rows_, row.data(), count, next.data());
        for (std::size_t j = 0; j < row.size(); ++j) row[j] = next[j] * (R(step_) / R(k + 1));
    }
}

template <class R>
void Propagator<R>::advance_by_power(int level, R* y, R* scratch) const {
    Arithmetic<R>::multiply(rows_, n_, power(level).data(), rows_, y, 1, scratch);
    std::copy_n(scratch, rows_, y);
}

template <class R>
void Propagator<R>::advance(R* y, R length, R* scratch) const {
    const R rest = halve(length, [&](int level) { advance_by_power(level, y, scratch); });
    if (rest > R(0)) Arithmetic<R>::taylor(rows_, n_, A_.data(), rest, order_, y, scratch);
}

template double spectral_bound<double>(const Matrix<double>&);
template int terms_for<double>(double);
template std::vector<Watched<double>> watched_quantities<double>(const Matrix<double>&);
template class Propagator<double>;
template class Propagator<long double>;

}  // namespace dualdrive::exact
