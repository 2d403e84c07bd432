// The kernels on any scalar: built ones for double, plain loops for the reference arithmetic.
#pragma once

#include <algorithm>
#include <utility>

#include "kernels.hpp"

namespace dualdrive::exact {

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
};

}  // namespace dualdrive::exact
