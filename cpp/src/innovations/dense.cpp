#include "dense.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "../solvers/exact/kernels.hpp"

namespace dualdrive::innovations {

using Eigen::MatrixXd;

namespace {

constexpr double dependent = 1e-15;  // of a diagonal: below it a pivot is rounding
constexpr double longest = 1.0;      // of ‖X‖: 1/17! is below rounding
constexpr int most_halvings = 40;

// Room of each thread for what the kernels take and give: products come by the million, and their room would cost as much.
Eigen::Map<MatrixXd> room(std::vector<double>& kept, Eigen::Index rows, Eigen::Index columns) {
    const auto size = static_cast<std::size_t>(rows * columns);
    if (kept.size() < size) kept.resize(size);
    return {kept.data(), rows, columns};
}

int halvings_to(double size) {
    int halvings = 0;
    for (; size > longest && halvings < most_halvings; size /= 2) ++halvings;
    return halvings;
}

// Σ c_k Xᵏ over 0 ≤ k ≤ 16, six products (Paterson, Stockmeyer, SIAM Journal on Computing 2 (1973) 60–66).
MatrixXd polynomial(const MatrixXd& X, const std::array<double, 17>& c) {
    const MatrixXd X2 = product(X, X), X3 = product(X, X2), X4 = product(X2, X2);
    MatrixXd sum = c[16] * X4;
    for (int k = 12; k >= 0; k -= 4) {
        const auto at = static_cast<std::size_t>(k);
        if (k < 12) sum = product(X4, sum);
        sum += c[at + 1] * X + c[at + 2] * X2 + c[at + 3] * X3;
        sum.diagonal().array() += c[at];
    }
    return sum;
}

// 1/(k + later)!
std::array<double, 17> reciprocal_factorials(int later) {
    std::array<double, 17> c{};
    double factorial = 1.0;
    for (int k = 2; k <= later; ++k) factorial *= k;
    for (int k = 0; k <= 16; ++k) {
        if (k > 0) factorial *= k + later;
        c[static_cast<std::size_t>(k)] = 1.0 / factorial;
    }
    return c;
}

}  // namespace

MatrixXd padded_rows(const MatrixXd& A) {
    MatrixXd wide(exact::padded(static_cast<int>(A.rows())), A.cols());
    wide.topRows(A.rows()) = A;
    wide.bottomRows(wide.rows() - A.rows()).setZero();
    return wide;
}

std::vector<double> packed_rows(const MatrixXd& A) {
    const MatrixXd wide = padded_rows(A);
    return {wide.data(), wide.data() + wide.size()};
}

MatrixXd product(const MatrixXd& A, const MatrixXd& B) {
    const auto rows = static_cast<int>(A.rows()), inner = static_cast<int>(A.cols()), padded = exact::padded(rows),
               columns = static_cast<int>(B.cols());
    const auto multiply = [&](const double* M, double* out) {
        exact::kernels().product(padded, inner, M, inner, B.data(), columns, out);
    };
    if (padded == rows) {
        MatrixXd out(rows, columns);
        multiply(A.data(), out.data());
        return out;
    }
    thread_local std::vector<double> taken, given;
    auto wide = room(taken, padded, inner);
    wide.topRows(rows) = A;
    wide.bottomRows(padded - rows).setZero();
    const auto out = room(given, padded, columns);
    multiply(wide.data(), given.data());
    return out.topRows(rows);
}

MatrixXd inverse(const MatrixXd& A) {
    const auto n = static_cast<int>(A.rows());
    MatrixXd own = padded_rows(A);
    std::vector<int> scratch(static_cast<std::size_t>(n));
    if (!exact::kernels().invert(static_cast<int>(own.rows()), n, own.data(), scratch.data()))
        return MatrixXd::Constant(n, n, std::numeric_limits<double>::quiet_NaN());
    return own.topRows(n);
}

MatrixXd cholesky_factor(const MatrixXd& A) {
    MatrixXd own = padded_rows(A);
    std::vector<double> scratch(static_cast<std::size_t>(A.cols()));
    exact::kernels().cholesky(static_cast<int>(own.rows()), static_cast<int>(A.cols()), dependent, own.data(),
                              scratch.data());
    return own.topRows(A.rows());
}

double spectral_bound(const MatrixXd& A) {
    MatrixXd B = A.cwiseAbs();
    bool scaled = true;
    for (int sweep = 0; sweep < 6 && scaled; ++sweep) {  // balanced by powers of two
        scaled = false;
        for (Eigen::Index i = 0; i < B.rows(); ++i) {
            const double row = B.row(i).sum() - B(i, i), column = B.col(i).sum() - B(i, i);
            if (!(row > 0 && column > 0) || (row < 2 * column && column < 2 * row)) continue;
            const double f = std::exp2(std::round(std::log2(row / column) / 2));
            B.row(i) /= f;
            B.col(i) *= f;
            scaled = true;
        }
    }
    double bound = 0.0;  // max √(row sum · column sum), A. Ostrowski (1951)
    for (Eigen::Index i = 0; i < B.rows(); ++i) bound = std::max(bound, std::sqrt(B.row(i).sum() * B.col(i).sum()));
    return bound;
}

namespace {

// e^X − 1 for X = A h.
MatrixXd exponential_less_one(const MatrixXd& A, double h) {
    const int halvings = halvings_to(spectral_bound(A) * std::abs(h));
    static const std::array<double, 17> coefficients = [] {
        auto c = reciprocal_factorials(0);
        c[0] = 0.0;
        return c;
    }();
    MatrixXd F = polynomial(A * (h / std::exp2(halvings)), coefficients);
    for (int k = 0; k < halvings; ++k) F = 2.0 * F + product(F, F);
    return F;
}

}  // namespace

MatrixXd exponential(const MatrixXd& A, double h) {
    MatrixXd F = exponential_less_one(A, h);
    F.diagonal().array() += 1.0;
    return F;
}

std::vector<MatrixXd> exponentials_of_halves(const MatrixXd& A, double h, int times) {
    std::vector<MatrixXd> found(static_cast<std::size_t>(times) + 1);
    MatrixXd F = exponential_less_one(A, h / std::exp2(times));
    for (int k = times; k >= 0; --k) {
        MatrixXd& own = found[static_cast<std::size_t>(k)] = F;
        own.diagonal().array() += 1.0;
        if (k > 0) F = 2.0 * F + product(F, F);
    }
    return found;
}

Exponentials exponentials(const MatrixXd& A, double h) {
    const auto n = A.rows();
    const MatrixXd one = MatrixXd::Identity(n, n);
    const int halvings = halvings_to(spectral_bound(A) * std::abs(h));
    const MatrixXd X = A * (h / std::exp2(halvings));
    static const auto coefficients = reciprocal_factorials(3);
    MatrixXd phi3 = polynomial(X, coefficients), phi2 = 0.5 * one + product(X, phi3), phi1 = one + product(X, phi2),
             flow = one + product(X, phi1);
    for (int k = 0; k < halvings; ++k) {
        phi3 = 0.125 * (product(phi1, phi2) + 2.0 * phi3 + phi2);
        phi2 = 0.25 * (product(phi1, phi1) + 2.0 * phi2);
        phi1 = 0.5 * (product(flow, phi1) + phi1);
        flow = product(flow, flow);
    }
    return {flow, phi1 * h, phi2 * h, phi3 * h};
}

}  // namespace dualdrive::innovations
