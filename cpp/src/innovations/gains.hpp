// The linear state space of one contact pattern over a sample, sensors' noise included, and its Kalman gains.
#pragma once

#include <Eigen/Core>

#include "flow.hpp"
#include "riccati.hpp"

namespace dualdrive::innovations {

// x_{k+1} = F x_k + w, y_k = C x_k + v with covariances Q and R; F by phase of the ticks of sampled loops; x = (states of
// the machine, torques of unknown course, noise of the sensors, that of a sample before where it is of order two, their zeros
// where those drift).
struct StateSpace {
    std::vector<Eigen::MatrixXd> F;
    Eigen::MatrixXd Q, C, R;

    StateSpace(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern, double speed);

    Eigen::VectorXd scale() const;                          // typical size of each state within a short while
    KalmanGains::Set gain(const Eigen::MatrixXd& P) const;  // from the covariance before a measurement
    // From a covariance at a phase: of that phase and those which follow it, by phase.
    KalmanGains::Phased gains(Eigen::MatrixXd P, std::size_t phase) const;
    KalmanGains::Phased steady() const;  // throws std::domain_error
    // Covariance of what is not known at first; of the machine's states by their standard deviations.
    Eigen::MatrixXd start(const Eigen::VectorXd& deviation) const;
    // The covariance before the next measurement, from that before this one and its gain.
    Eigen::MatrixXd next(const Eigen::MatrixXd& P, const KalmanGains::Set& set, std::size_t phase) const;

    // The covariance before a measurement, so many samples later.
    class Later {
      public:
        explicit Later(const StateSpace& space);
        Eigen::MatrixXd operator()(const Eigen::MatrixXd& P, std::size_t phase, std::size_t samples);

      private:
        Eigen::VectorXd scale_;
        RiccatiDoubling doubling_;
    };

  private:
    // In units of `scale` and of the outputs' own sizes; of every state a share `kept` a sample.
    RiccatiDoubling doubling(const Eigen::VectorXd& scale, double kept) const;

    Eigen::MatrixXd stationary_;  // covariance of what is no state of the machine
    Eigen::Index states_;         // of the machine alone
    Eigen::Index sensors_;        // first of the sensors' noise
    double step_;                 // s
};

constexpr std::size_t one_by_one = 50;  // first samples with gains of their own

// The gains of a contact pattern for the first samples of a stretch: one by one, then eight of every octave, each that of the
// middle of the samples which it serves.
class FirstGains {
  public:
    // deviation: of the machine's states at first; phase: of the first sample; kept: where the gains stand.
    FirstGains(const StateSpace& space, const Eigen::VectorXd& deviation, std::size_t phase, KalmanGains::First& kept);
    // Works them out until one serves the sample, counted from the first, or `steady` does.
    void reach(std::size_t sample, const KalmanGains::Phased& steady);
    const KalmanGains::First& kept() const { return kept_; }

  private:
    StateSpace space_;
    StateSpace::Later later_;
    std::size_t phase_;
    KalmanGains::First& kept_;
};

// Of one contact pattern. Throws std::domain_error.
KalmanGains::Phased steady_gain(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern,
                                double speed);

}  // namespace dualdrive::innovations
