#include "tangent_gradient.hpp"

#include <algorithm>
#include <cmath>

#include "../exact/arithmetic.hpp"
#include "terms.hpp"

namespace dualdrive::exponential {

namespace {

using Packed = std::vector<double>;

void add(Packed& to, const Packed& what, double factor) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += factor * what[i];
}

}  // namespace

TangentGradient::TangentGradient(Propagators& propagators, int states)
    : propagators_(propagators),
      states_(states),
      lambda_rows_(exact::padded(states)),
      n_(propagators.size()),
      rows_(propagators.rows()),
      m_(static_cast<int>(propagators.driven().size())),
      width_(propagators.width()),
      tall_(exact::padded(lambda_rows_ + width_ - rows_)),
      A_transposed_(exact::states_transposed(rows_, states_, propagators.A())),
      A_(static_cast<std::size_t>(lambda_rows_ * n_), 0.0) {}

TangentGradient::Packed TangentGradient::product(const Packed& M, int n, const Packed& x, int count) const {
    Packed out(static_cast<std::size_t>(lambda_rows_ * count));
    const int ldx = count > 0 ? static_cast<int>(x.size()) / count : 0;
    exact::kernels().product(lambda_rows_, n, M.data(), ldx, x.data(), count, out.data());
    return out;
}

void TangentGradient::back(int level, const double* lambda, double* out) {
    Packed& T = transposed_[level];
    if (T.empty()) {
        const double* const M = propagators_.step(level);
        T.assign(static_cast<std::size_t>(tall_ * states_), 0.0);
        for (int r = 0; r < states_; ++r) {
            for (int c = 0; c < states_; ++c) T[static_cast<std::size_t>(r * tall_ + c)] = M[c * rows_ + r];
            for (int c = rows_; c < width_; ++c)
                T[static_cast<std::size_t>(r * tall_ + lambda_rows_ + c - rows_)] = M[c * rows_ + r];
        }
    }
    exact::kernels().multiply(tall_, states_, T.data(), lambda_rows_, lambda, 1, out);
}

void TangentGradient::keep(int level, int count, const double* yc, const double* lambda) {
    Packed& sum = kept_[level];
    if (sum.empty()) sum.assign(static_cast<std::size_t>(lambda_rows_ * width_), 0.0);
    exact::kernels().add_outer(lambda_rows_, width_, count, lambda, width_, yc, sum.data());
}

// v_{i+1} = r A v_i/(i + 1) + r B c_i/(i + 1)!, and y after it is the sum. Backwards v̄_i = λ + r Aᵀ v̄_{i+1}/(i + 1).
void TangentGradient::series_back(double length, const double* yc, const double* lambda, bool keep, double* out) {
    const int order = std::max(propagators_.order(), static_cast<int>(terms));
    const auto tall = static_cast<std::size_t>(lambda_rows_);
    std::vector<Packed> v(static_cast<std::size_t>(order));
    v[0].assign(yc, yc + rows_);
    double factorial = 1.0;
    const auto& driven = propagators_.driven();
    for (int i = 0; i + 1 < order; ++i) {
        Packed& next = v[static_cast<std::size_t>(i) + 1];
        next.resize(static_cast<std::size_t>(rows_));
        propagators_.rates(v[static_cast<std::size_t>(i)].data(), next.data());
        for (double& x : next) x *= length / (i + 1);
        factorial *= i + 1;
        for (std::size_t r = 0; r < driven.size() && i < static_cast<int>(terms); ++r)
            next[static_cast<std::size_t>(driven[r])] += length * yc[rows_ + i * m_ + static_cast<int>(r)] / factorial;
    }
    factorial *= order;
    Packed bar(lambda, lambda + tall), scaled(tall), before(tall);
    std::fill_n(out, tall_, 0.0);
    for (int i = order - 1; i >= 0; --i) {
        for (std::size_t r = 0; r < driven.size() && i < static_cast<int>(terms); ++r)
            out[lambda_rows_ + i * m_ + static_cast<int>(r)] =
                length / factorial * bar[static_cast<std::size_t>(driven[r])];
        factorial /= i + 1;
        for (std::size_t k = 0; k < tall; ++k) scaled[k] = length / (i + 1) * bar[k];
        if (keep)
            exact::kernels().add_outer(lambda_rows_, n_, 1, scaled.data(), rows_, v[static_cast<std::size_t>(i)].data(),
                                       A_.data());
        exact::kernels().multiply(lambda_rows_, states_, A_transposed_.data(), lambda_rows_, scaled.data(), 1,
                                  before.data());
        for (std::size_t k = 0; k < tall; ++k) bar[k] = lambda[k] + before[k];
    }
    std::copy(bar.begin(), bar.end(), out);
}

void TangentGradient::keep_rest(int count, const double* yc, const double* rest) {
    weights_.assign(static_cast<std::size_t>(lambda_rows_ * count), 0.0);
    for (int k = 0; k < count; ++k)
        for (int r = 0; r < m_; ++r)
            weights_[static_cast<std::size_t>(k * lambda_rows_ + propagators_.driven()[static_cast<std::size_t>(r)])] =
                -rest[k * m_ + r];
    exact::kernels().add_outer(lambda_rows_, n_, count, weights_.data(), width_, yc, A_.data());
}

// ------------------------------------------------------------------------------------------- from propagators to A

void TangentGradient::add_kept(int level, Shares& shares) {
    const auto known = kept_.find(level);
    if (known == kept_.end()) return;
    const auto phi = known->second.begin() + lambda_rows_ * rows_;
    for (int i = 0; i < lambda_rows_ * n_; ++i)
        shares.less_one[static_cast<std::size_t>(i)] += known->second[static_cast<std::size_t>(i)];
    for (std::size_t i = 0; i < shares.phi.size(); ++i) shares.phi[i] += phi[static_cast<std::ptrdiff_t>(i)];
}

// Φ_1 B, … of a level as rows × (terms m).
TangentGradient::Packed TangentGradient::phi_of(int level) const {
    const double* const M = propagators_.step(level);
    return {M + rows_ * rows_, M + rows_ * width_};
}

// From a level to the one below it, backwards through Propagators::doubled:
//     F ← 2 F + F²,   Φ_k ← 2^{−k} (Φ_k + F Φ_k + Σ_{j ≤ k} Φ_j/(k − j)!)
void TangentGradient::halve(int level, Shares& shares) const {
    const Packed& F = propagators_.less_one(level - 1);
    const Packed F_states = exact::states_transposed(rows_, states_, F), F_transposed = exact::transposed(rows_, n_, F);
    Packed below = product(shares.less_one, n_, F_transposed, n_);
    add(below, product(F_states, states_, shares.less_one, n_), 1.0);
    add(below, shares.less_one, 2.0);
    const auto block = static_cast<std::size_t>(lambda_rows_ * m_);
    if (m_ > 0) {
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t i = 0; i < block; ++i) shares.phi[k * block + i] *= std::ldexp(1.0, -static_cast<int>(k));
        const Packed phi = phi_of(level - 1);
        const int columns = static_cast<int>(terms) * m_;
        Packed across(static_cast<std::size_t>(columns * n_));  // Φᵀ
        for (int c = 0; c < n_; ++c)
            for (int q = 0; q < columns; ++q)
                across[static_cast<std::size_t>(c * columns + q)] = phi[static_cast<std::size_t>(q * rows_ + c)];
        add(below, product(shares.phi, columns, across, n_), 1.0);
        Packed under = product(F_states, states_, shares.phi, columns);
        add(under, shares.phi, 1.0);
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t j = 0; j <= k; ++j)
                for (std::size_t i = 0; i < block; ++i)
                    under[j * block + i] += inverse_factorial[k - j] * shares.phi[k * block + i];
        shares.phi.swap(under);
    }
    shares.less_one.swap(below);
}

// Backwards through Horner's rule F ← (X + X F)/k.
void TangentGradient::exponential_back(const Packed& X, const Packed& X_transposed, Packed bar, Packed& owed) const {
    const int order = propagators_.order();
    std::vector<Packed> F(static_cast<std::size_t>(order) + 2, Packed(X.size(), 0.0));
    for (int k = order; k > 0; --k) {
        Packed& now = F[static_cast<std::size_t>(k)];
        exact::kernels().product(rows_, n_, X.data(), rows_, F[static_cast<std::size_t>(k) + 1].data(), n_, now.data());
        for (std::size_t i = 0; i < now.size(); ++i) now[i] = (now[i] + X[i]) / k;
    }
    for (int k = 1; k <= order; ++k) {
        for (double& each : bar) each /= k;
        add(owed, bar, 1.0);
        add(owed, product(bar, n_, exact::transposed(rows_, n_, F[static_cast<std::size_t>(k) + 1]), n_), 1.0);
        bar = product(X_transposed, states_, bar, n_);
    }
}

// Backwards through φ_k = X φ_{k+1} + B/k!.
void TangentGradient::phi_back(double length, const Packed& X, const Packed& X_transposed, const Packed& bars,
                               Packed& owed) const {
    const int last = static_cast<int>(terms) + propagators_.order();
    std::vector<Packed> phi(static_cast<std::size_t>(last) + 2, Packed(static_cast<std::size_t>(rows_ * m_), 0.0));
    double factorial = std::tgamma(last + 1.0);
    for (int k = last; k > 0; factorial /= k, --k) {
        Packed& now = phi[static_cast<std::size_t>(k)];
        exact::kernels().product(rows_, n_, X.data(), rows_, phi[static_cast<std::size_t>(k) + 1].data(), m_,
                                 now.data());
        for (int r = 0; r < m_; ++r)
            now[static_cast<std::size_t>(r * rows_ + propagators_.driven()[static_cast<std::size_t>(r)])] +=
                1.0 / factorial;
    }
    const auto block = static_cast<std::size_t>(lambda_rows_ * m_);
    Packed bar(block, 0.0);
    for (int k = 1; k <= last; ++k) {
        for (std::size_t i = 0; i < block && k <= static_cast<int>(terms); ++i)
            bar[i] += length * bars[static_cast<std::size_t>(k - 1) * block + i];
        Packed across(static_cast<std::size_t>(m_ * n_));
        for (int c = 0; c < n_; ++c)
            for (int r = 0; r < m_; ++r)
                across[static_cast<std::size_t>(c * m_ + r)] =
                    phi[static_cast<std::size_t>(k) + 1][static_cast<std::size_t>(r * rows_ + c)];
        add(owed, product(bar, m_, across, n_), 1.0);
        bar = product(X_transposed, states_, bar, m_);
    }
}

// From a level whose propagators came from series.
void TangentGradient::finest_back(double length, Shares shares) {
    Packed X = propagators_.A(), X_transposed = A_transposed_, owed(A_.size(), 0.0);
    for (double& x : X) x *= length;
    for (double& x : X_transposed) x *= length;
    exponential_back(X, X_transposed, std::move(shares.less_one), owed);
    if (m_ > 0) phi_back(length, X, X_transposed, shares.phi, owed);
    add(A_, owed, length);
}

const TangentGradient::Packed& TangentGradient::total() {
    if (closed_ || kept_.empty()) return A_;
    closed_ = true;
    const int finest = propagators_.finest();
    const auto nothing = [&] {
        return Shares{Packed(A_.size(), 0.0), Packed(static_cast<std::size_t>(lambda_rows_ * m_) * terms, 0.0)};
    };
    Shares shares = nothing();
    for (int level = kept_.rbegin()->first; level >= finest; --level) {
        add_kept(level, shares);
        if (level > finest) halve(level, shares);
    }
    finest_back(std::ldexp(propagators_.unit(), finest), std::move(shares));
    for (const auto& [level, kept] : kept_) {
        if (level >= finest) break;
        Shares own = nothing();
        add_kept(level, own);
        finest_back(std::ldexp(propagators_.unit(), level), std::move(own));
    }
    return A_;
}

}  // namespace dualdrive::exponential
