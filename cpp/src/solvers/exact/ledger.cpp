#include "ledger.hpp"

#include <algorithm>

#include "arithmetic.hpp"

namespace dualdrive::exact {

namespace {

// W's series needs more terms than that of e^A: its rates are sums of two of A's, and two chains of integrators may
// stand in front of them.
constexpr int more_terms = 3;

}  // namespace

template <class R>
Ledger<R>::Ledger(const Energies<R>& forms, const Propagator<R>& law)
    : law_(law),
      n_(law.size()),
      ld_(law.rows()),
      products_(static_cast<std::size_t>(n_ * (n_ + 1) / 2)),
      y_(static_cast<std::size_t>(ld_)),
      scratch_(static_cast<std::size_t>(2 * ld_)) {
    std::vector<Square> power;
    for (std::size_t path = 0; path < powers; ++path) {
        if (forms[path].size() == 0) continue;
        paths_.push_back(path);
        power.push_back(square(forms[path]));
    }
    rows_ = padded(static_cast<int>(std::max<std::size_t>(1, paths_.size())));
    sums_.resize(static_cast<std::size_t>(rows_));
    if (forms[powers].size() > 0) stored_ = pack({square(forms[powers])});
    find_parts(std::move(power));
}

template <class R>
void Ledger<R>::find_parts(std::vector<Square> derivative) {
    const Square A = law_.A();
    std::vector<Square> W(derivative.size(), Square(A.size(), R(0)));
    R weight(1);  // r^{k+1}/(k+1)!
    const R finest = R(law_.step()) / R(1 << levels);
    for (int k = 0; k < law_.order() + more_terms; ++k) {
        if (k < smooth) derivatives_[static_cast<std::size_t>(k)] = pack(derivative);
        weight *= finest / R(k + 1);
        for (std::size_t p = 0; p < W.size(); ++p) {
            Square& M = derivative[p];
            for (std::size_t i = 0; i < M.size(); ++i) W[p][i] += weight * M[i];
            const Square MA = times(M, A), AM = transposed(MA);
            for (std::size_t i = 0; i < M.size(); ++i) M[i] = MA[i] + AM[i];
        }
    }
    parts_[levels] = pack(W);
    for (int level = levels; level > 0; --level) {
        const Square &E = law_.power(level), Et = transposed(E);
        for (Square& w : W) {
            const Square later = times(Et, times(w, E));
            for (std::size_t i = 0; i < w.size(); ++i) w[i] += later[i];
        }
        parts_[static_cast<std::size_t>(level - 1)] = pack(W);
    }
}

template <class R>
void Ledger<R>::add_step(const R* y, double* energy) {
    add(of_form(parts_[0], products(y)), energy);
}

template <class R>
void Ledger<R>::add_part(const R* y, R length, double* energy) {
    std::copy_n(y, ld_, y_.data());
    const R rest = law_.halve(length, [&](int level) {
        add(of_form(parts_[static_cast<std::size_t>(level)], products(y_.data())), energy);
        law_.advance_by_power(level, y_.data(), scratch_.data());
    });
    if (rest > R(0)) add_short(y_.data(), rest, energy);
}

// Hermite's quadrature of order 2m from m derivatives at both ends (C. Lanczos, Applied Analysis, 1956, VI.18):
// ∫ p = Σ_k  m! (2m−k)! / ((2m)! k! (m−k)!)  r^k (p^{(k−1)}(0) − (−1)^k p^{(k−1)}(r)).
template <class R>
void Ledger<R>::add_short(R* y, R length, double* energy) {
    for (const int end : {0, 1}) {
        const R* const yy = products(y);
        R weight = length / R(2);
        for (int k = 1; k <= smooth; ++k) {
            const R* const p = of_form(derivatives_[static_cast<std::size_t>(k - 1)], yy);
            const R signed_weight = end == 1 && k % 2 == 0 ? -weight : weight;
            for (std::size_t i = 0; i < paths_.size(); ++i)
                energy[paths_[i]] += static_cast<double>(signed_weight * p[i]);
            weight *= length * R(smooth - k) / R((k + 1) * (2 * smooth - k));
        }
        if (end == 0) law_.advance(y, length, scratch_.data());
    }
}

template <class R>
double Ledger<R>::stored(const R* y) {
    if (stored_.empty()) return 0.0;
    const R* const yy = products(y);
    return static_cast<double>(*of_form(stored_, yy));
}

// y_i y_j, i ≤ j.
template <class R>
const R* Ledger<R>::products(const R* y) {
    R* to = products_.data();
    for (int j = 0; j < n_; ++j)
        for (int i = 0; i <= j; ++i) *to++ = y[i] * y[j];
    return products_.data();
}

template <class R>
const R* Ledger<R>::of_form(const std::vector<R>& rows, const R* products) {
    const int count = n_ * (n_ + 1) / 2;
    Arithmetic<R>::multiply(rows_, count, rows.data(), count, products, 1, sums_.data());
    return sums_.data();
}

template <class R>
void Ledger<R>::add(const R* sums, double* energy) const {
    for (std::size_t i = 0; i < paths_.size(); ++i) energy[paths_[i]] += static_cast<double>(sums[i]);
}

template <class R>
typename Ledger<R>::Square Ledger<R>::square(const Matrix<R>& form) const {
    Square s(static_cast<std::size_t>(ld_ * n_), R(0));
    for (int j = 0; j < n_; ++j)
        for (int i = 0; i < n_; ++i) s[static_cast<std::size_t>(j * ld_ + i)] = form(i, j);
    return s;
}

template <class R>
typename Ledger<R>::Square Ledger<R>::times(const Square& a, const Square& b) const {
    Square product(a.size());
    Arithmetic<R>::multiply(ld_, n_, a.data(), ld_, b.data(), n_, product.data());
    return product;
}

template <class R>
typename Ledger<R>::Square Ledger<R>::transposed(const Square& a) const {
    Square t(a.size(), R(0));
    for (int j = 0; j < n_; ++j)
        for (int i = 0; i < n_; ++i)
            t[static_cast<std::size_t>(j * ld_ + i)] = a[static_cast<std::size_t>(i * ld_ + j)];
    return t;
}

// One row per form, one column per product y_i y_j.
template <class R>
std::vector<R> Ledger<R>::pack(const std::vector<Square>& forms) const {
    std::vector<R> packed(static_cast<std::size_t>(rows_) * products_.size(), R(0));
    for (std::size_t row = 0; row < forms.size(); ++row) {
        std::size_t column = 0;
        for (int j = 0; j < n_; ++j)
            for (int i = 0; i <= j; ++i, ++column) {
                const R half = forms[row][static_cast<std::size_t>(j * ld_ + i)];
                packed[column * static_cast<std::size_t>(rows_) + row] = i == j ? half : R(2) * half;
            }
    }
    return packed;
}

template class Ledger<double>;
template class Ledger<long double>;

}  // namespace dualdrive::exact
