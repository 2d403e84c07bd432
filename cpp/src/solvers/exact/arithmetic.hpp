// The kernels on any scalar: built ones for double, plain loops for the reference arithmetic.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "kernels.hpp"

namespace dualdrive::exact {

// Of the upper n × n part of a packed matrix.
// Of the leading states × states part: columns of `rows`, transposed ones of padded(states).
template <class R>
std::vector<R> states_transposed(int rows, int states, const std::vector<R>& M) {
    const int out = padded(states);
    std::vector<R> T(static_cast<std::size_t>(out * states), R(0.0));
    for (int c = 0; c < states; ++c)
        for (int r = 0; r < states; ++r)
            T[static_cast<std::size_t>(r * out + c)] = M[static_cast<std::size_t>(c * rows + r)];
    return T;
}

template <class R>
std::vector<R> transposed(int rows, int n, const std::vector<R>& M) {
    std::vector<R> T(M.size(), R(0));
    for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r)
            T[static_cast<std::size_t>(r * rows + c)] = M[static_cast<std::size_t>(c * rows + r)];
    return T;
}

template <class R>
struct Arithmetic {
    // A lane's sums stay in registers: a long double is slow to store.
    static void product(int rows, int n, const R* M, const R* x, R* out) {
        static_assert(lane == 4);
        for (int i = 0; i < rows; i += lane) {
            R a(0), b(0), c(0), d(0);
            for (int j = 0; j < n; ++j) {
                const R* m = M + j * rows + i;
                a += m[0] * x[j];
                b += m[1] * x[j];
                c += m[2] * x[j];
                d += m[3] * x[j];
            }
            out[i] = a;
            out[i + 1] = b;
            out[i + 2] = c;
            out[i + 3] = d;
        }
    }
    static void multiply(int rows, int n, const R* M, int ldx, const R* x, int count, R* out) {
        for (int k = 0; k < count; ++k) product(rows, n, M, x + k * ldx, out + k * rows);
    }
    static void chain(int rows, int n, const R* M, int count, R* y) {
        for (int k = 0; k < count; ++k) product(rows, n, M, y + k * rows, y + (k + 1) * rows);
    }
    static void taylor(int rows, int n, const R* A, R r, int order, R* y, R* scratch) {
        R *term = scratch, *next = scratch + rows;
        std::copy_n(y, rows, term);
        for (int k = 1; k <= order; ++k) {
            product(rows, n, A, term, next);
            for (int i = 0; i < rows; ++i) y[i] += next[i] *= r / R(k);
            std::swap(term, next);
        }
    }
    static void largest(int rows, int count, const R* y, R* out) {
        std::fill_n(out, rows, R(0));
        for (int k = 0; k < count; ++k)
            for (int i = 0; i < rows; ++i) out[i] = std::max(out[i], std::abs(y[k * rows + i]));
    }
    static int suspect(int m, int from, int count, R fraction, const R* watched, const R* margin, const R* upper) {
        const R square = fraction * fraction;
        for (int k = from; k < count; ++k) {
            const R *a = watched + static_cast<std::ptrdiff_t>(k) * 3 * m, *b = a + 3 * m;
            for (int i = 0; i < m; ++i) {
                const R b1 = a[i] + fraction * a[m + i], b2 = b1 + fraction * a[m + i] + square * a[2 * m + i];
                const R b4 = b[i] - fraction * b[m + i], b3 = b4 - fraction * b[m + i] + square * b[2 * m + i];
                const auto [low, high] = std::minmax({a[i], b1, b2, b3, b4, b[i]});
                if (!(low > margin[i]) || !(high + margin[i] < upper[i])) return k;
            }
        }
        return count;
    }
};

template <>
struct Arithmetic<double> {
    static void multiply(int rows, int n, const double* M, int ldx, const double* x, int count, double* out) {
        kernels().multiply(rows, n, M, ldx, x, count, out);
    }
    static void chain(int rows, int n, const double* M, int count, double* y) { kernels().chain(rows, n, M, count, y); }
    static void taylor(int rows, int n, const double* A, double r, int order, double* y, double* scratch) {
        kernels().taylor(rows, n, A, r, order, y, scratch);
    }
    static void largest(int rows, int count, const double* y, double* out) { kernels().largest(rows, count, y, out); }
    static int suspect(int m, int from, int count, double fraction, const double* watched, const double* margin,
                       const double* upper) {
        return kernels().suspect(m, from, count, fraction, watched, margin, upper);
    }
};

}  // namespace dualdrive::exact
