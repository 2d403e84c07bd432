#include "riccati.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "../solvers/exact/kernels.hpp"

namespace dualdrive::innovations {

using Eigen::MatrixXd;

namespace {

constexpr std::size_t most_doublings = 40;  // a horizon of 10¹² samples
constexpr double converged_at = 1e-11;      // relative change of P

}  // namespace

MatrixXd product(const MatrixXd& A, const MatrixXd& B) {
    const auto rows = static_cast<int>(A.rows()), inner = static_cast<int>(A.cols()), padded = exact::padded(rows);
    if (padded == rows) {
        MatrixXd out(rows, B.cols());
        exact::kernels().multiply(rows, inner, A.data(), inner, B.data(), static_cast<int>(B.cols()), out.data());
        return out;
    }
    MatrixXd wide(padded, inner), out(padded, B.cols());
    wide.topRows(rows) = A;
    wide.bottomRows(padded - rows).setZero();
    exact::kernels().multiply(padded, inner, wide.data(), inner, B.data(), static_cast<int>(B.cols()), out.data());
    return out.topRows(rows);
}

RiccatiDoubling::RiccatiDoubling(const std::vector<MatrixXd>& F, const MatrixXd& Q, const MatrixXd& C,
                                 const MatrixXd& R) {
    const MatrixXd G = C.transpose() * R.ldlt().solve(C);
    for (const MatrixXd& own : F) phases_.push_back({own.transpose(), G, Q});
}

RiccatiDoubling::Level RiccatiDoubling::both(const Level& first, const Level& second) {
    const MatrixXd one = MatrixXd::Identity(first.A.rows(), first.A.cols());
    const MatrixXd W = (one + product(second.G, first.H)).partialPivLu().inverse(), AW = product(first.A, W);
    const MatrixXd G = first.G + product(product(AW, second.G), first.A.transpose());
    const MatrixXd H = second.H + product(second.A.transpose(), product(first.H, product(W, second.A)));
    return {product(AW, second.A), 0.5 * (G + G.transpose()), 0.5 * (H + H.transpose())};
}

// P = L L': A' P (1 + G P)⁻¹ A = X' X with X = M^(−1/2) L' A, M = 1 + L' G L, which stays a covariance whatever the rounding.
MatrixXd RiccatiDoubling::through(const Level& level, const MatrixXd& P) {
    const Eigen::LDLT<MatrixXd> factor(P);
    const Eigen::VectorXd roots = factor.vectorD().cwiseMax(0.0).cwiseSqrt();
    MatrixXd L = factor.matrixL();
    L = factor.transpositionsP().transpose() * (L * roots.asDiagonal()).eval();
    MatrixXd M = product(product(L.transpose(), level.G), L);
    M.diagonal().array() += 1.0;
    const Eigen::LLT<MatrixXd> inner(M);
    const MatrixXd X = inner.matrixL().solve(product(L.transpose(), level.A));
    return level.H + product(X.transpose(), X);
}

const RiccatiDoubling::Level& RiccatiDoubling::level(std::size_t k) {
    if (levels_.empty()) {
        levels_.push_back(phases_.front());
        for (std::size_t phase = 1; phase < phases_.size(); ++phase)
            levels_.back() = both(levels_.back(), phases_[phase]);
    }
    while (levels_.size() <= k) levels_.push_back(both(levels_.back(), levels_.back()));
    return levels_[k];
}

MatrixXd RiccatiDoubling::after(MatrixXd P, std::size_t phase, std::size_t samples) {
    for (; samples > 0 && phase != 0; --samples, phase = (phase + 1) % phases_.size()) P = through(phases_[phase], P);
    std::size_t periods = samples / phases_.size();
    for (std::size_t k = 0; periods > 0; ++k, periods /= 2)
        if (periods % 2 == 1) P = through(level(k), P);
    for (samples %= phases_.size(); samples > 0; --samples, ++phase) P = through(phases_[phase], P);
    return P;
}

Steady RiccatiDoubling::steady() {
    for (std::size_t k = 1; k <= most_doublings; ++k) {
        const MatrixXd H = level(k).H, before = level(k - 1).H;
        if (!H.allFinite()) return {before, false};
        if ((H - before).norm() <= converged_at * H.norm()) return {H, true};
    }
    return {levels_.back().H, false};
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
