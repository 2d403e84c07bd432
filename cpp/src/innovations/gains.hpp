// The linear state space of one contact pattern over a sample, sensors' noise included, and its Kalman gains.
#pragma once

#include <Eigen/Core>

#include "flow.hpp"

namespace dualdrive::innovations {

// x_{k+1} = F x_k + w, y_k = C x_k + v with covariances Q and R; x = (states of the machine, torques of
// unknown course, noise of the sensors, their zeros where those drift).
struct StateSpace {
    Eigen::MatrixXd F, Q, C, R;

    StateSpace(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern, double speed);
    StateSpace(const Frozen& frozen, Flow& flow, const SampledRecord& record, const NoiseModel& noise);

    Eigen::VectorXd scale() const;                                // typical size of each state within a short while
    KalmanGains::Set gain(const Eigen::MatrixXd& P) const;        // from the covariance before a measurement
    KalmanGains::Set steady(const Eigen::VectorXd& scale) const;  // throws std::domain_error
    // Covariance of what is not known at first; of the machine's states by their standard deviations.
    Eigen::MatrixXd start(const Eigen::VectorXd& deviation) const;
    Eigen::MatrixXd next(const Eigen::MatrixXd& P, const KalmanGains::Set& set) const;

  private:
    Eigen::Index states_;   // of the machine alone
    Eigen::Index sensors_;  // first of the sensors' noise
    double step_;           // s
};

// Of one contact pattern. Throws std::domain_error.
KalmanGains::Set steady_gain(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern,
                             double speed);

}  // namespace dualdrive::innovations
