// The steady state of a Kalman filter.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dualdrive::innovations {

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
    // The covariance so many periods after one at phase 0.
    Eigen::MatrixXd after(const Eigen::MatrixXd& P, std::size_t periods);
    Steady steady();  // at phase 0

  private:
    struct Level {
        Eigen::MatrixXd A, G, H;  // P⁺ = H + A' P (1 + G P)⁻¹ A
    };
    static Level both(const Level& first, const Level& second);
    static Eigen::MatrixXd through(const Level& level, const Eigen::MatrixXd& P);
    const Level& level(std::size_t k);
    Eigen::Index size_;                   // of P; those of the levels are padded
    std::vector<Level> phases_, levels_;  // over one sample; over 2ᵏ periods
};

}  // namespace dualdrive::innovations
