// The steady state of a Kalman filter.
#pragma once

#include <Eigen/Core>

namespace dualdrive::innovations {

struct Steady {
    Eigen::MatrixXd P;  // covariance of the state before a measurement
    bool converged;
};

// P = F P F' + Q − F P C' (C P C' + R)⁻¹ C P F', by the structure-preserving doubling algorithm: each pass squares the
// horizon. Chu, Fan, Lin, Wang, International Journal of Control 77 (2004) 767–788.
Steady steady_covariance(const Eigen::MatrixXd& F, const Eigen::MatrixXd& Q, const Eigen::MatrixXd& C,
                         const Eigen::MatrixXd& R);

// e^X and h φ₁(X), h φ₂(X) for X = A h: φ₁ = (e^X − 1)/X, φ₂ = (e^X − 1 − X)/X²; Taylor series of a halved X, then
// e^2X = e^X e^X, φ₁(2X) = (e^X + 1) φ₁(X)/2, φ₂(2X) = (φ₁(X)² + 2 φ₂(X))/4 (Hochbruck, Ostermann, Acta Numerica 19 (2010)
// 209–286, §3).
struct Exponentials {
    Eigen::MatrixXd flow, phi1, phi2;
};
// A bound on the spectral radius of |A| that does not depend on the units of the states.
double spectral_bound(const Eigen::MatrixXd& A);
Exponentials exponentials(const Eigen::MatrixXd& A, double h);

}  // namespace dualdrive::innovations
