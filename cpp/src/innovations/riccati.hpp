// The steady state of a Kalman filter.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dualdrive::innovations {

// A B by the exact engine's kernels: these matrices are too small for a library's blocks.
Eigen::MatrixXd product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

struct Steady {
    Eigen::MatrixXd P;  // covariance of the state before a measurement
    bool converged;
};

// P⁺ = F P F' + Q − F P C' (C P C' + R)⁻¹ C P F', F by phase, over one sample, over a period, and over 2, 4, … periods at
// once, by the structure-preserving doubling algorithm: each level squares the horizon. Chu, Fan, Lin, Wang, International
// Journal of Control 77 (2004) 767–788; periodic: Chu, Fan, Lin, Wang, International Journal of Control 77 (2004) 767 and
// Linear Algebra and its Applications 377 (2004) 1–22.
class RiccatiDoubling {
  public:
    RiccatiDoubling(const std::vector<Eigen::MatrixXd>& F, const Eigen::MatrixXd& Q, const Eigen::MatrixXd& C,
                    const Eigen::MatrixXd& R);
    // The covariance so many samples after one of a phase.
    Eigen::MatrixXd after(Eigen::MatrixXd P, std::size_t phase, std::size_t samples);
    Steady steady();  // at phase 0

  private:
    struct Level {
        Eigen::MatrixXd A, G, H;  // P⁺ = H + A' P (1 + G P)⁻¹ A
    };
    static Level both(const Level& first, const Level& second);
    static Eigen::MatrixXd through(const Level& level, const Eigen::MatrixXd& P);
    const Level& level(std::size_t k);
    std::vector<Level> phases_, levels_;  // over one sample; over 2ᵏ periods
};

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
