// Small dense matrices by the kernels of the exact engine: too small for a library's blocks, too many for its plain loops.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dualdrive::innovations {

// With rows of zeros below, as many as the kernels want.
Eigen::MatrixXd padded_rows(const Eigen::MatrixXd& A);
std::vector<double> packed_rows(const Eigen::MatrixXd& A);

Eigen::MatrixXd product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

// Not a number where there is none.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& A);

// L of a positive semidefinite L L', triangular but for the order of its columns; what depends on others becomes 0.
Eigen::MatrixXd cholesky_factor(const Eigen::MatrixXd& A);

// A bound on the spectral radius of |A| that does not depend on the units of the states.
double spectral_bound(const Eigen::MatrixXd& A);

// e^X for X = A h: the Taylor series of a halved X, e^2X − 1 = (e^X − 1)(e^X + 1).
Eigen::MatrixXd exponential(const Eigen::MatrixXd& A, double h);

// e^(A h / 2^k) for 0 ≤ k ≤ times: the squarings on its way, kept.
std::vector<Eigen::MatrixXd> exponentials_of_halves(const Eigen::MatrixXd& A, double h, int times);

// e^X and h φ₁(X), h φ₂(X), h φ₃(X): φ₁ = (e^X − 1)/X, φ₂ = (φ₁ − 1)/X, φ₃ = (φ₂ − ½)/X; φ₁(2X) = (e^X + 1) φ₁(X)/2, φ₂(2X)
// = (φ₁(X)² + 2 φ₂(X))/4, φ₃(2X) = (φ₁(X) φ₂(X) + 2 φ₃(X) + φ₂(X))/8 (Hochbruck, Ostermann, Acta Numerica 19 (2010) 209–286,
// §3).
struct Exponentials {
    Eigen::MatrixXd flow, phi1, phi2, phi3;
};
Exponentials exponentials(const Eigen::MatrixXd& A, double h);

}  // namespace dualdrive::innovations
