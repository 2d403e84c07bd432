// The gains of a stay in one pattern of modes.
#pragma once

#include "gains.hpp"

namespace dualdrive::innovations {

constexpr std::size_t one_by_one = 50;  // first samples with gains of their own

// Works them out until some serve the sample, counted from the first, or the steady ones do: one by one, then eight of every
// octave, each that of the middle of the samples which it serves. steady: null where they are not known.
void reach(KalmanGains::Sojourn& sojourn, StateSpace& space, std::size_t sample, const KalmanGains::Phased* steady);

// The covariance before a sample of it.
Eigen::MatrixXd covariance(const KalmanGains::Sojourn& sojourn, StateSpace& space, std::size_t sample);

}  // namespace dualdrive::innovations
