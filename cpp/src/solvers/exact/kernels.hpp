// The few loops in which the exact engine and the Kalman filters spend their time, built once for every processor the program may meet.
//
// Matrices are column-major with a leading dimension that is a multiple of `lane`; vectors have as many entries. Which
// build runs is chosen when the program starts; DUALDRIVE_KERNELS in the environment (baseline, avx2, avx512) names another.
#pragma once

namespace dualdrive::exact {

inline constexpr int lane = 4;
inline constexpr int padded(int n) { return (n + lane - 1) / lane * lane; }

struct Kernels {
    const char* name;
    // out[:, k] = M x[:, k] for k < count. M has `rows` rows and n columns, x a leading dimension ldx.
    void (*multiply)(int rows, int n, const double* M, int ldx, const double* x, int count, double* out);
    // y[:, k + 1] = M y[:, k] for k < count.
    void (*chain)(int rows, int n, const double* M, int count, double* y);
    // y = Σ (A r)^k y / k! for k ≤ order; `scratch` holds 2 × rows.
    void (*taylor)(int rows, int n, const double* A, double r, int order, double* y, double* scratch);
    // The way back. y[:, k − 1] += M y[:, k] from k = count down to 1.
    void (*chain_back)(int rows, int n, const double* M, int count, double* y);
    // terms[:, k] = A terms[:, k − 1] r/k for k ≤ order; and backwards from λ, with bars[:, order] its first: each scaled by
    // r/k, then bars[:, k − 1] = λ + A' bars[:, k]; bars[:, 0] is what λ becomes.
    void (*series)(int rows, int n, const double* A, double r, int order, double* terms);
    void (*series_back)(int rows, int n, const double* transposed, double r, int order, const double* lambda,
                        double* bars);
    // sum[:, c] += Σ a[:, k] b[c, k] over k < count, for c < n.
    void (*add_outer)(int rows, int n, int count, const double* a, int ldb, const double* b, double* sum);
    // out[i] = max |y[i, k]| over k < count.
    void (*largest)(int rows, int count, const double* y, double* out);
    // The first k ≥ from, k < count, at which the Bernstein coefficients of any quintic do not keep their margin from 0 and
    // their upper limit; else count. watched: values, slopes/5 and curvatures/20, m of each, at count + 1 times; `fraction`
    // of a step lies between these.
    int (*suspect)(int m, int from, int count, double fraction, const double* watched, const double* margin,
                   const double* upper);
    // As `multiply`, of many columns at once: sums in another order.
    void (*product)(int rows, int n, const double* M, int ldx, const double* x, int count, double* out);
    // A ← A⁻¹, n × n, by Gauss and Jordan with the largest pivot of each column; false where there is none. `scratch` holds
    // n whole numbers.
    bool (*invert)(int rows, int n, double* A, int* scratch);
    // A ← L, A = L L', of a positive semidefinite A, by the pivot that is largest beside its diagonal (Higham, Accuracy and
    // Stability of Numerical Algorithms, 2nd ed., 10.3): L is triangular but for the order of its columns, and where all
    // pivots left are below `least` of their diagonals, so is all that is left, and becomes 0. `scratch` holds n numbers.
    void (*cholesky)(int rows, int n, double least, double* A, double* scratch);
};

// Throws std::invalid_argument when the environment asks for what is not there.
const Kernels& kernels();

namespace build {
extern const Kernels baseline;
#if DUALDRIVE_KERNELS_X86
extern const Kernels avx2, avx512;
#endif
}  // namespace build

}  // namespace dualdrive::exact
