#include "riccati.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace dualdrive::innovations {

using Eigen::MatrixXd;

namespace {

constexpr int most_doublings = 40;      // a horizon of 10¹² samples
constexpr double converged_at = 1e-11;  // relative change of P

}  // namespace

Steady steady_covariance(const MatrixXd& F, const MatrixXd& Q, const MatrixXd& C, const MatrixXd& R) {
    const auto n = F.rows();
    const MatrixXd one = MatrixXd::Identity(n, n);
    MatrixXd A = F.transpose(), G = C.transpose() * R.ldlt().solve(C), H = Q;
    for (int pass = 0; pass < most_doublings; ++pass) {
        const MatrixXd W = (one + G * H).partialPivLu().inverse();
        const MatrixXd AW = A * W;
        MatrixXd next = H + A.transpose() * H * W * A;
        next = (0.5 * (next + next.transpose())).eval();
        MatrixXd wider = G + AW * G * A.transpose();
        G = 0.5 * (wider + wider.transpose());
        A = (AW * A).eval();
        if (!next.allFinite()) return {H, false};
        const double change = (next - H).norm(), size = next.norm();
        H = next;
        if (change <= converged_at * size) return {H, true};
    }
    return {H, false};
}

double spectral_bound(const MatrixXd& A) {
    MatrixXd B = A.cwiseAbs();
    for (int sweep = 0; sweep < 6; ++sweep)  // balanced by powers of two
        for (Eigen::Index i = 0; i < B.rows(); ++i) {
            const double row = B.row(i).sum() - B(i, i), column = B.col(i).sum() - B(i, i);
            if (!(row > 0 && column > 0)) continue;
            const double f = std::exp2(std::round(std::log2(row / column) / 2));
            B.row(i) /= f;
            B.col(i) *= f;
        }
    double bound = 0.0;  // max √(row sum · column sum), A. Ostrowski (1951)
    for (Eigen::Index i = 0; i < B.rows(); ++i) bound = std::max(bound, std::sqrt(B.row(i).sum() * B.col(i).sum()));
    return bound;
}

Exponentials exponentials(const MatrixXd& A, double h) {
    const auto n = A.rows();
    const MatrixXd one = MatrixXd::Identity(n, n);
    const double bound = spectral_bound(A);
    int halvings = 0;
    double size = bound * std::abs(h);
    for (; size > 0.5 && halvings < 40; size /= 2) ++halvings;
    const MatrixXd X = A * (h / std::exp2(halvings));
    constexpr int terms = 16;  // 0.5¹⁶/18! is below rounding
    MatrixXd phi2 = MatrixXd::Zero(n, n);
    for (int k = terms; k >= 0; --k) {  // φ₂ = Σ Xᵏ/(k+2)!
        double factorial = 1.0;
        for (int j = 2; j <= k + 2; ++j) factorial *= j;
        phi2 = (X * phi2).eval();
        phi2.diagonal().array() += 1.0 / factorial;
    }
    MatrixXd phi1 = one + X * phi2, flow = one + X * phi1;
    for (int k = 0; k < halvings; ++k) {
        const MatrixXd square = phi1 * phi1;
        phi2 = 0.25 * (square + 2.0 * phi2);
        phi1 = (0.5 * (flow * phi1 + phi1)).eval();
        flow = (flow * flow).eval();
    }
    return {flow, phi1 * h, phi2 * h};
}

}  // namespace dualdrive::innovations
