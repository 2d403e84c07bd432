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

template <int W>
inline void store(double* p, typename VectorOf<W>::type v) {
    std::memcpy(p, &v, sizeof v);
}

template <class V>
inline V lesser(V a, V b) {
    return a < b ? a : b;
}

template <class V>
inline V greater(V a, V b) {
    return a > b ? a : b;
}

// What becomes of a sum M x: it is put down; or it is the next term of a series, which is also added up.
struct Put {
    double* out;
    template <int W>
    void take(int row, typename VectorOf<W>::type sum) const {
        store<W>(out + row, sum);
    }
};
struct PutTerm {
    double factor;
    double *term, *total;
    template <int W>
    void take(int row, typename VectorOf<W>::type sum) const {
        sum *= factor;
        store<W>(term + row, sum);
        store<W>(total + row, load<W>(total + row) + sum);
    }
};

struct Add {
    double* out;
    template <int W>
    void take(int row, typename VectorOf<W>::type sum) const {
        store<W>(out + row, load<W>(out + row) + sum);
    }
};
struct PutScaled {
    double factor;
    double* out;
    template <int W>
    void take(int row, typename VectorOf<W>::type sum) const {
        store<W>(out + row, sum * factor);
    }
};
struct PutShifted {
    const double* shift;
    double* out;
    template <int W>
    void take(int row, typename VectorOf<W>::type sum) const {
        store<W>(out + row, load<W>(shift + row) + sum);
    }
};

// `count` vectors of W rows from `row` on, all columns: even and odd columns are summed apart, so that the sums wait less on
// each other.
template <int W, int count, class Sink>
inline void tile(int rows, int n, const double* M, const double* x, int stride, int row, const Sink& sink) {
    using V = typename VectorOf<W>::type;
    V even[count], odd[count];
    for (int k = 0; k < count; ++k) even[k] = odd[k] = V{};
    int j = 0;
    for (; j + 1 < n; j += 2) {
        const double *a = M + j * rows + row, *b = a + rows;
        const double xa = x[j * stride], xb = x[(j + 1) * stride];
        for (int k = 0; k < count; ++k) {
            even[k] += load<W>(a + k * W) * xa;
            odd[k] += load<W>(b + k * W) * xb;
        }
    }
    if (j < n)
        for (int k = 0; k < count; ++k) even[k] += load<W>(M + j * rows + row + k * W) * x[j * stride];
    for (int k = 0; k < count; ++k) sink.template take<W>(row + k * W, even[k] + odd[k]);
}

constexpr int narrow = WIDTH < 4 ? WIDTH : 4;  // vectors of a lane

template <class Sink>
inline void product(int rows, int n, const double* M, const double* x, const Sink& sink, int stride = 1) {
    int r = 0;
    if constexpr (WIDTH == 8)  // has thirty-two registers
        for (; r + 32 <= rows; r += 32) tile<8, 4>(rows, n, M, x, stride, r, sink);
    for (; r + 16 <= rows; r += 16) {
        if constexpr (WIDTH == 2) {  // sixteen registers hold no more sums than these
            tile<2, 4>(rows, n, M, x, stride, r, sink);
            tile<2, 4>(rows, n, M, x, stride, r + 8, sink);
        } else {
            tile<WIDTH, 16 / WIDTH>(rows, n, M, x, stride, r, sink);
        }
    }
    if (WIDTH > 2 && r + 12 <= rows) {
        tile<narrow, 12 / narrow>(rows, n, M, x, stride, r, sink);
        r += 12;
    }
    if (r + 8 <= rows) {
        tile<WIDTH, 8 / WIDTH>(rows, n, M, x, stride, r, sink);
        r += 8;
    }
    if (r < rows) tile<narrow, 4 / narrow>(rows, n, M, x, stride, r, sink);
}

void multiply(int rows, int n, const double* M, int ldx, const double* x, int count, double* out) {
    for (int k = 0; k < count; ++k) product(rows, n, M, x + k * ldx, Put{out + k * rows});
}

void chain(int rows, int n, const double* M, int count, double* y) {
    for (int k = 0; k < count; ++k) product(rows, n, M, y + k * rows, Put{y + (k + 1) * rows});
}

void taylor(int rows, int n, const double* A, double r, int order, double* y, double* scratch) {
    double *term = scratch, *next = scratch + rows;
    std::memcpy(term, y, static_cast<unsigned long>(rows) * sizeof(double));
    for (int k = 1; k <= order; ++k) {
        product(rows, n, A, term, PutTerm{r / k, next, y});
        double* const swap = term;
        term = next;
        next = swap;
    }
}

void chain_back(int rows, int n, const double* M, int count, double* y) {
    for (int k = count; k > 0; --k) product(rows, n, M, y + k * rows, Add{y + (k - 1) * rows});
}

void series(int rows, int n, const double* A, double r, int order, double* terms) {
    for (int k = 1; k <= order; ++k) product(rows, n, A, terms + (k - 1) * rows, PutScaled{r / k, terms + k * rows});
}

void series_back(int rows, int n, const double* transposed, double r, int order, const double* lambda, double* bars) {
    for (int k = order; k > 0; --k) {
        double* const bar = bars + k * rows;
        for (int i = 0; i < rows; ++i) bar[i] *= r / k;
        product(rows, n, transposed, bar, PutShifted{lambda, bar - rows});
    }
}

void add_outer(int rows, int n, int count, const double* a, int ldb, const double* b, double* sum) {
    for (int c = 0; c < n; ++c) product(rows, count, a, b + c, Add{sum + c * rows}, ldb);
}

void largest(int rows, int count, const double* y, double* out) {
    using V = typename VectorOf<narrow>::type;
    for (int i = 0; i < rows; i += narrow) {
        V most{};
        for (int k = 0; k < count; ++k) {
            const V v = load<narrow>(y + k * rows + i);
            most = greater(most, greater(v, -v));
        }
        store<narrow>(out + i, most);
    }
}

int suspect(int m, int from, int count, double fraction, const double* watched, const double* margin,
            const double* upper) {
    using V = typename VectorOf<narrow>::type;
    const double square = fraction * fraction;
    for (int k = from; k < count; ++k) {
        const double *a = watched + static_cast<long>(k) * 3 * m, *b = a + 3 * m;
        auto near = V{} < V{};
        for (int i = 0; i < m; i += narrow) {
            const V b0 = load<narrow>(a + i), b5 = load<narrow>(b + i);
            const V slope = load<narrow>(a + m + i) * fraction, last = load<narrow>(b + m + i) * fraction;
            const V b1 = b0 + slope, b2 = b1 + slope + load<narrow>(a + 2 * m + i) * square;
            const V b4 = b5 - last, b3 = b4 - last + load<narrow>(b + 2 * m + i) * square;
            const V low = lesser(lesser(lesser(b0, b5), lesser(b1, b2)), lesser(b3, b4));
            const V high = greater(greater(greater(b0, b5), greater(b1, b2)), greater(b3, b4));
            const V apart = load<narrow>(margin + i);
            near |= ~(low > apart) | ~(high + apart < load<narrow>(upper + i));
        }
        long any = 0;
        for (int i = 0; i < narrow; ++i) any |= near[i];
        if (any != 0) return k;
    }
    return count;
}

// `tall` vectors of W rows from `row` on, of `wide` columns: each number that is read serves several sums.
template <int W, int tall, int wide>
inline void block(int rows, int n, const double* M, int ldx, const double* x, int row, double* out) {
    using V = typename VectorOf<W>::type;
    V sum[wide][tall];
    for (int c = 0; c < wide; ++c)
        for (int k = 0; k < tall; ++k) sum[c][k] = V{};
    const double* a = M + row;
    for (int j = 0; j < n; ++j, a += rows) {
        V column[tall];
        for (int k = 0; k < tall; ++k) column[k] = load<W>(a + k * W);
        for (int c = 0; c < wide; ++c) {
            const double factor = x[c * ldx + j];
            for (int k = 0; k < tall; ++k) sum[c][k] += column[k] * factor;
        }
    }
    for (int c = 0; c < wide; ++c)
        for (int k = 0; k < tall; ++k) store<W>(out + c * rows + row + k * W, sum[c][k]);
}

template <int wide>
inline void columns(int rows, int n, const double* M, int ldx, const double* x, double* out) {
    int r = 0;
    for (; r + 2 * WIDTH <= rows; r += 2 * WIDTH) block<WIDTH, 2, wide>(rows, n, M, ldx, x, r, out);
    if (r + WIDTH <= rows) {
        block<WIDTH, 1, wide>(rows, n, M, ldx, x, r, out);
        r += WIDTH;
    }
    if (r < rows) block<narrow, 1, wide>(rows, n, M, ldx, x, r, out);
}

void matrix_product(int rows, int n, const double* M, int ldx, const double* x, int count, double* out) {
    int c = 0;
    for (; c + 4 <= count; c += 4) columns<4>(rows, n, M, ldx, x + c * ldx, out + c * rows);
    for (; c < count; ++c) columns<1>(rows, n, M, ldx, x + c * ldx, out + c * rows);
}

// y += a x over whole rows.
inline void axpy(int rows, double a, const double* x, double* y) {
    int i = 0;
    for (; i + WIDTH <= rows; i += WIDTH) store<WIDTH>(y + i, load<WIDTH>(y + i) + load<WIDTH>(x + i) * a);
    if (i < rows) store<narrow>(y + i, load<narrow>(y + i) + load<narrow>(x + i) * a);
}

bool invert(int rows, int n, double* A, int* scratch) {
    for (int k = 0; k < n; ++k) {
        double* const own = A + k * rows;
        int p = k;
        for (int i = k + 1; i < n; ++i)
            if (__builtin_fabs(own[i]) > __builtin_fabs(own[p])) p = i;
        scratch[k] = p;
        if (!(__builtin_fabs(own[p]) > 0.0)) return false;
        if (p != k)
            for (int j = 0; j < n; ++j) {
                const double other = A[j * rows + k];
                A[j * rows + k] = A[j * rows + p];
                A[j * rows + p] = other;
            }
        const double inverse = 1.0 / own[k];
        own[k] = 0.0;
        for (int j = 0; j < n; ++j) {
            if (j == k) continue;
            double* const column = A + j * rows;
            const double factor = column[k] * inverse;
            axpy(rows, -factor, own, column);
            column[k] = factor;
        }
        for (int i = 0; i < n; ++i) own[i] *= -inverse;
        own[k] = inverse;
    }
    for (int k = n - 1; k >= 0; --k)  // rows were exchanged, so columns are
        if (const int p = scratch[k]; p != k)
            for (int i = 0; i < rows; ++i) {
                const double other = A[k * rows + i];
                A[k * rows + i] = A[p * rows + i];
                A[p * rows + i] = other;
            }
    return true;
}

void cholesky(int rows, int n, double least, double* A, double* diagonal) {
    for (int k = 0; k < n; ++k) diagonal[k] = A[k * rows + k];
    for (int step = 0; step < n; ++step) {
        int next = -1;
        double most = least;
        for (int k = 0; k < n; ++k)
            if (diagonal[k] > 0.0 && A[k * rows + k] > most * diagonal[k]) {
                next = k;
                most = A[k * rows + k] / diagonal[k];
            }
        if (next < 0) break;
        double* const own = A + next * rows;
        const double inverse = 1.0 / __builtin_sqrt(own[next]);
        diagonal[next] = -1.0;  // it is a column of L from now on
        for (int i = 0; i < rows; ++i) own[i] *= inverse;
        for (int i = 0; i < n; ++i)
            if (diagonal[i] < 0.0 && i != next) own[i] = 0.0;
        for (int k = 0; k < n; ++k)
            if (!(diagonal[k] < 0.0)) axpy(rows, -own[k], own, A + k * rows);
    }
    for (int k = 0; k < n; ++k)
        if (!(diagonal[k] < 0.0))
            for (int i = 0; i < rows; ++i) A[k * rows + i] = 0.0;
}

}  // namespace

const Kernels build::BUILD = {BUILD_NAME, &multiply, &chain,   &taylor,         &chain_back, &series,  &series_back,
                              &add_outer, &largest,  &suspect, &matrix_product, &invert,     &cholesky};

}  // namespace dualdrive::exact
