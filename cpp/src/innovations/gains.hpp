// The linear state space of one pattern of modes over a sample, sensors' noise included, and its Kalman gains.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "flow.hpp"
#include "riccati.hpp"

namespace dualdrive::innovations {

// What torques of unknown course and sensors keep of themselves over a sample, written into F: torques from row and column
// `first` on, then the noise of the sensors, that of a sample before where it is of order two, their zeros where those drift.
void write_memories(const NoiseModel& noise, Eigen::Index first, Eigen::MatrixXd& F);

// x_{k+1} = F x_k + w, y_k = C x_k + v with covariances Q and R; F by phase of the ticks of sampled loops; x = (states of
// the machine, torques of unknown course, noise of the sensors, that of a sample before where it is of order two, their zeros
// where those drift). Covariances of x have padded rows, as the kernels want them: zeros below.
class StateSpace {
  public:
    StateSpace(Flow& flow, const SampledRecord& record, const NoiseModel& noise, const Modes& pattern, double speed);

    std::size_t phases() const { return F_.size(); }
    Eigen::Index outputs() const { return C_.rows(); }
    const std::vector<Eigen::MatrixXd>& F() const { return F_; }
    const Eigen::MatrixXd& C() const { return C_; }
    const Eigen::VectorXd& scale();                   // typical size of each state within a short while
    KalmanGains::Set gain(const Eigen::MatrixXd& P);  // from the covariance before a measurement
    // From a covariance at a phase: of that phase and those which follow it, by phase.
    KalmanGains::Phased gains(Eigen::MatrixXd P, std::size_t phase);
    KalmanGains::Phased steady() { return gains(steady_covariance(), 0); }  // throws std::domain_error
    // Covariance of what is not known at first; of the machine's states by their standard deviations.
    Eigen::MatrixXd start(const Eigen::VectorXd& deviation) const;
    // P, a covariance before a measurement, becomes that before the next one.
    void next(Eigen::MatrixXd& P, const KalmanGains::Set& set, std::size_t phase);
    // The covariance before a measurement at phase 0, so many periods of the ticks later.
    Eigen::MatrixXd later(const Eigen::MatrixXd& P, std::size_t periods);

  private:
    Eigen::Index size() const { return Q_.rows(); }
    Eigen::VectorXd reached() const;
    const Eigen::VectorXd& units();       // `scale`, 1 where that is 0
    Eigen::MatrixXd steady_covariance();  // before a measurement at phase 0
    // In these units and the outputs' own sizes; of every state a share `kept` a sample.
    RiccatiDoubling doubling(double kept);
    RiccatiDoubling& horizon();  // all of every state kept; empty until asked for

    struct Entry {
        Eigen::Index row, column;
        double value;
    };
    struct Moved {  // rows of F of the machine's states, as far as they are not 0: padded, and transposed
        Eigen::MatrixXd rows, transposed;
    };
    std::vector<Eigen::MatrixXd> F_;
    std::vector<Moved> moved_;
    Eigen::MatrixXd Q_, C_, R_;
    Eigen::MatrixXd seen_;        // C' of the machine's states
    std::vector<Entry> own_;      // of F, what is no state of the machine and no tick changes
    Eigen::MatrixXd stationary_;  // covariance of what is no state of the machine
    Eigen::Index states_;         // of the machine alone
    Eigen::Index sensors_;        // first of the sensors' noise
    Eigen::Index zeros_ = 0;      // of their zeros; 0 where none drift
    double step_;                 // s
    Eigen::VectorXd scale_, units_;
    std::unique_ptr<RiccatiDoubling> horizon_;
    Eigen::MatrixXd shown_, gained_, across_, back_, half_;  // room for a step: there are millions
};

}  // namespace dualdrive::innovations
