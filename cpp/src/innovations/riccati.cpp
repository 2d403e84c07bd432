#include "riccati.hpp"

#include <Eigen/Cholesky>

#include "../solvers/exact/kernels.hpp"
#include "dense.hpp"

namespace dualdrive::innovations {

using Eigen::MatrixXd;

namespace {

constexpr std::size_t most_doublings = 40;  // a horizon of 10¹² samples
constexpr double converged_at = 1e-11;      // relative change of P

// With rows and columns of zeros, as many as the kernels want: states that nothing moves.
MatrixXd padded_square(const MatrixXd& A) {
    const Eigen::Index size = exact::padded(static_cast<int>(A.rows()));
    MatrixXd square = MatrixXd::Zero(size, size);
    square.topLeftCorner(A.rows(), A.cols()) = A;
    return square;
}

}  // namespace

RiccatiDoubling::RiccatiDoubling(const std::vector<MatrixXd>& F, const MatrixXd& Q, const MatrixXd& C,
                                 const MatrixXd& R)
    : size_(Q.rows()) {
    const MatrixXd G = padded_square(C.transpose() * R.ldlt().solve(C)), H = padded_square(Q);
    for (const MatrixXd& own : F) phases_.push_back({padded_square(own.transpose()), G, H});
}

RiccatiDoubling::Level RiccatiDoubling::both(const Level& first, const Level& second) {
    const MatrixXd one = MatrixXd::Identity(first.A.rows(), first.A.cols());
    const MatrixXd W = inverse(one + product(second.G, first.H)), AW = product(first.A, W);
    const MatrixXd G = first.G + product(product(AW, second.G), first.A.transpose());
    const MatrixXd H = second.H + product(second.A.transpose(), product(first.H, product(W, second.A)));
    return {product(AW, second.A), 0.5 * (G + G.transpose()), 0.5 * (H + H.transpose())};
}

// P = L L': A' P (1 + G P)⁻¹ A = Y' M⁻¹ Y with Y = L' A, M = 1 + L' G L, which stays a covariance whatever the rounding.
MatrixXd RiccatiDoubling::through(const Level& level, const MatrixXd& P) {
    const MatrixXd L = cholesky_factor(P), transposed = L.transpose();
    MatrixXd M = product(product(transposed, level.G), L);
    M.diagonal().array() += 1.0;
    const MatrixXd Y = product(transposed, level.A);
    const MatrixXd next = level.H + product(Y.transpose(), product(inverse(M), Y));
    return 0.5 * (next + next.transpose());
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

MatrixXd RiccatiDoubling::after(const MatrixXd& P, std::size_t periods) {
    MatrixXd later = padded_square(P);
    for (std::size_t k = 0; periods > 0; ++k, periods /= 2)
        if (periods % 2 == 1) later = through(level(k), later);
    return later.topLeftCorner(size_, size_);
}

Steady RiccatiDoubling::steady() {
    for (std::size_t k = 1; k <= most_doublings; ++k) {
        const MatrixXd H = level(k).H, before = level(k - 1).H;
        const auto own = [&](const MatrixXd& M) { return M.topLeftCorner(size_, size_); };
        if (!H.allFinite()) return {own(before), false};
        if ((H - before).norm() <= converged_at * H.norm()) return {own(H), true};
    }
    return {levels_.back().H.topLeftCorner(size_, size_), false};
}

}  // namespace dualdrive::innovations
