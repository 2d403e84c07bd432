#include "gains.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "riccati.hpp"

namespace dualdrive {

bool NoiseModel::drifts() const {
    return std::any_of(sensors.begin(), sensors.end(), [](const SensorNoise& s) { return s.drift.drive > 0.0; });
}

namespace innovations {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int short_while = 100;      // samples within which a state's typical size is reached
constexpr double forgotten = 100.0;   // s: see steady()
constexpr double unknown = 100.0;     // of that size: what is not known of the first state
constexpr double white_floor = 1e-3;  // of a sensor's drive: no reading is exact, and R has an inverse

}  // namespace

StateSpace::StateSpace(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern, double speed)
    : StateSpace(flow.tangent(pattern, speed), flow, record, noise) {}

StateSpace::StateSpace(const Frozen& frozen, Flow& flow, const SampledRecord& record, const NoiseModel& noise)
    : states_(flow.states()) {
    const auto states = static_cast<Eigen::Index>(flow.states()), torques = Eigen::Index{flow.torque_count()},
               n = states + torques, m = static_cast<Eigen::Index>(record.channels().size());
    const bool drifts = noise.drifts();
    const Eigen::Index size = n + (drifts ? 2 : 1) * m;
    const MatrixXd flowed = flow.over_a_sample(frozen);
    sensors_ = n;
    step_ = record.step();
    F = MatrixXd::Zero(size, size);
    F.topLeftCorner(states, states) = flowed.topLeftCorner(states, states);
    F.block(0, states, states, torques) = flowed.block(0, flow.first_torque(), states, torques);
    Q = MatrixXd::Zero(size, size);
    C = MatrixXd::Zero(m, size);
    C.leftCols(states) = frozen.outputs.leftCols(states);
    C.middleCols(n, m) = MatrixXd::Identity(m, m);
    if (drifts) C.rightCols(m) = MatrixXd::Identity(m, m);
    R = MatrixXd::Zero(m, m);
    for (Eigen::Index j = 0; j < m; ++j) {
        const SensorNoise& s = noise.sensors[static_cast<std::size_t>(j)];
        F(n + j, n + j) = s.memory;
        Q(n + j, n + j) = s.drive * s.drive;
        if (drifts) {
            F(n + m + j, n + m + j) = s.drift.memory;
            Q(n + m + j, n + m + j) = s.drift.drive * s.drift.drive;
        }
        R(j, j) = s.white * s.white + white_floor * white_floor * s.drive * s.drive;
    }
    Eigen::Index b = states;
    for (const auto& [body, torque] : noise.torque) {
        F(b, b) = torque.memory;
        Q(b, b) = torque.drive * torque.drive;
        ++b;
    }
}

VectorXd StateSpace::scale() const {
    MatrixXd reached = Q, power = F;
    for (int k = 1; k < short_while; k *= 2) {  // Σ Fᵏ Q F'ᵏ, doubled
        reached += (power * reached * power.transpose()).eval();
        power = (power * power).eval();
    }
    VectorXd s = reached.diagonal().cwiseMax(0.0).cwiseSqrt();
    return s;
}

KalmanGains::Set StateSpace::gain(const MatrixXd& P) const {
    const MatrixXd S = C * P * C.transpose() + R;
    const Eigen::LLT<MatrixXd> factor(S);
    KalmanGains::Set set;
    set.K = factor.solve(C * P).transpose();
    set.whitening = factor.matrixL().solve(MatrixXd::Identity(S.rows(), S.cols()));
    set.log_det = -2.0 * set.whitening.diagonal().array().log().sum();
    return set;
}

KalmanGains::Set StateSpace::steady(const VectorXd& reached) const {
    const VectorXd s = (reached.array() > 0.0).select(reached, 1.0);
    const auto scaled = [&](const MatrixXd& M) -> MatrixXd {
        return s.cwiseInverse().asDiagonal() * M * s.asDiagonal();
    };
    if (F.rows() == sensors_ + C.rows() && reached.head(sensors_).isZero(0)) {
        // a simulation: nothing but the sensors' own noise is to be learned
        MatrixXd P = MatrixXd::Zero(F.rows(), F.rows());
        for (Eigen::Index j = sensors_, k = 0; j < F.rows(); ++j, ++k) {
            const double f = F(j, j), q = Q(j, j), r = R(k, k), b = r * (1.0 - f * f) - q;
            P(j, j) = 0.5 * (-b + std::sqrt(b * b + 4.0 * q * r));
        }
        return gain(P);
    }
    const VectorXd outputs = (C * s.asDiagonal()).rowwise().norm().cwiseMax(R.diagonal().cwiseSqrt());
    const MatrixXd own = outputs.cwiseInverse().asDiagonal();
    const MatrixXd inverse = s.cwiseInverse().asDiagonal();
    const auto covariance = [&](double kept) {
        return steady_covariance(kept * scaled(F), inverse * Q * inverse, own * C * s.asDiagonal(), own * R * own);
    };
    // what nothing shows and nothing feels may walk away, as the difference of two slaves' equalisers does that both act on
    // the master: forgotten over minutes it stays finite, and no gain feels it
    Steady found = covariance(1.0);
    if (!found.converged) found = covariance(std::exp(-step_ / forgotten));
    if (!found.converged) throw std::domain_error("kalman_gains: no steady gain; a state grows that no sensor sees");
    return gain(s.asDiagonal() * found.P * s.asDiagonal());
}

MatrixXd StateSpace::start(const VectorXd& deviation) const {
    MatrixXd P = MatrixXd::Zero(F.rows(), F.rows());
    for (Eigen::Index k = 0; k < states_; ++k) P(k, k) = std::pow(deviation(k), 2);
    for (Eigen::Index k = states_; k < F.rows(); ++k) P(k, k) = Q(k, k) / std::max(1e-9, 1.0 - F(k, k) * F(k, k));
    return P;
}

MatrixXd StateSpace::next(const MatrixXd& P, const KalmanGains::Set& set) const {
    const MatrixXd after = P - set.K * (C * P);
    MatrixXd next = F * after * F.transpose() + Q;
    return 0.5 * (next + next.transpose());
}

KalmanGains::Set steady_gain(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern,
                             double speed) {
    const StateSpace space(flow, record, noise, pattern, speed);
    return space.steady(space.scale());
}

}  // namespace innovations

KalmanGains kalman_gains(const Machine& machine, const SampledRecord& record, const NoiseModel& noise, double speed,
                         const FirstState& first, bool every) {
    if (noise.sensors.size() != record.channels().size())
        throw std::invalid_argument("kalman_gains: " + std::to_string(noise.sensors.size()) + " noises for " +
                                    std::to_string(record.channels().size()) + " channels");
    std::vector<std::string> bodies;
    for (const auto& [body, torque] : noise.torque) bodies.push_back(body);
    innovations::Flow flow(machine, record, 1, bodies);
    KalmanGains gains;
    gains.noise = noise;
    gains.speed = speed;
    const unsigned all = flow.patterns() - 1;
    for (unsigned pattern = every ? 0 : all; pattern <= all; ++pattern)
        gains.steady[pattern] = innovations::steady_gain(flow, record, noise, pattern, speed);
    NoiseModel wide = noise;
    for (const auto& [body, torque] : first.torque)
        if (wide.torque.contains(body)) wide.torque[body] = torque;
    gains.at_first = innovations::unknown * innovations::StateSpace(flow, record, wide, all, speed).scale();
    for (const auto& [name, deviation] : first.deviation)
        if (const int k = flow.layout().state(name); k >= 0)
            gains.at_first(k) = std::hypot(gains.at_first(k), deviation);
    return gains;
}

}  // namespace dualdrive
