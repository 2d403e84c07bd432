// The loops of kernels.hpp for vectors of WIDTH numbers. Everything has internal linkage: a build for one processor must
// not lend its code to another's.
#include <cstring>

#include "kernels.hpp"

namespace dualdrive::exact {
namespace {

template <int W>
struct VectorOf {
    typedef double type __attribute__((vector_size(8 * W)));
};

template <int W>
inline typename VectorOf<W>::type load(const double* p) {
    typename VectorOf<W>::type v;
    std::memcpy(&v, p, sizeof v);
    return v;
}

// `count` vectors of W rows, all columns: even and odd columns are summed apart, so that the sums wait less on each other.
template <int W, int count>
inline void tile(int rows, int n, const double* M, const double* x, double* out) {
    using V = typename VectorOf<W>::type;
    V even[count], odd[count];
    for (int k = 0; k < count; ++k) even[k] = odd[k] = V{};
    int j = 0;
    for (; j + 1 < n; j += 2) {
        const double *a = M + j * rows, *b = a + rows;
        const double xa = x[j], xb = x[j + 1];
        for (int k = 0; k < count; ++k) {
            even[k] += load<W>(a + k * W) * xa;
            odd[k] += load<W>(b + k * W) * xb;
        }
    }
    if (j < n)
        for (int k = 0; k < count; ++k) even[k] += load<W>(M + j * rows + k * W) * x[j];
    for (int k = 0; k < count; ++k) {
        const V sum = even[k] + odd[k];
        std::memcpy(out + k * W, &sum, sizeof sum);
    }
}

inline void product(int rows, int n, const double* M, const double* x, double* out) {
    constexpr int narrow = WIDTH < 4 ? WIDTH : 4;
    int r = 0;
    for (; r + 16 <= rows; r += 16) {
        if constexpr (WIDTH == 2) {  // sixteen registers hold no more sums than these
            tile<2, 4>(rows, n, M + r, x, out + r);
            tile<2, 4>(rows, n, M + r + 8, x, out + r + 8);
        } else {
            tile<WIDTH, 16 / WIDTH>(rows, n, M + r, x, out + r);
        }
    }
    if (r + 8 <= rows) {
        tile<WIDTH, 8 / WIDTH>(rows, n, M + r, x, out + r);
        r += 8;
    }
    if (r < rows) tile<narrow, 4 / narrow>(rows, n, M + r, x, out + r);
}

void multiply(int rows, int n, const double* M, int ldx, const double* x, int count, double* out) {
    for (int k = 0; k < count; ++k) product(rows, n, M, x + k * ldx, out + k * rows);
}

void chain(int rows, int n, const double* M, int count, double* y) {
    for (int k = 0; k < count; ++k) product(rows, n, M, y + k * rows, y + (k + 1) * rows);
}

void taylor(int rows, int n, const double* A, double r, int order, double* y, double* scratch) {
    double *term = scratch, *next = scratch + rows;
    std::memcpy(term, y, static_cast<unsigned long>(rows) * sizeof(double));
    for (int k = 1; k <= order; ++k) {
        product(rows, n, A, term, next);
        const double factor = r / k;
        for (int i = 0; i < rows; ++i) {
            next[i] *= factor;
            y[i] += next[i];
        }
        double* const swap = term;
        term = next;
        next = swap;
    }
}

}  // namespace

const Kernels build::BUILD = {BUILD_NAME, &multiply, &chain, &taylor};

}  // namespace dualdrive::exact
