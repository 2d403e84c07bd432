#include "gains.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <stdexcept>

#include "riccati.hpp"

namespace dualdrive {

namespace innovations {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int short_while = 100;      // samples within which a state's typical size is reached
constexpr double unknown = 100.0;     // of that size: what is not known of the first state
constexpr double white_floor = 1e-3;  // of a sensor's drive: no reading is exact, and R has an inverse

}  // namespace

StateSpace::StateSpace(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern, double speed)
    : StateSpace(flow.tangent(pattern, speed), flow, record, noise) {}

StateSpace::StateSpace(const Frozen& frozen, const Flow& flow, const SampledRecord& record, const NoiseModel& noise)
    : states_(flow.states()) {
    const auto states = static_cast<Eigen::Index>(flow.states()), torques = Eigen::Index{flow.torque_count()},
               n = states + torques, m = static_cast<Eigen::Index>(record.channels().size());
    const Exponentials e = exponentials(frozen.A, record.step());
    F = MatrixXd::Zero(n + m, n + m);
    F.topLeftCorner(states, states) = e.flow.topLeftCorner(states, states);
    F.block(0, states, states, torques) = e.flow.block(0, flow.first_torque(), states, torques);
    Q = MatrixXd::Zero(n + m, n + m);
    C = MatrixXd::Zero(m, n + m);
    C.leftCols(states) = frozen.outputs.leftCols(states);
    C.rightCols(m) = MatrixXd::Identity(m, m);
    R = MatrixXd::Zero(m, m);
    for (Eigen::Index j = 0; j < m; ++j) {
        const SensorNoise& s = noise.sensors[static_cast<std::size_t>(j)];
        F(n + j, n + j) = s.memory;
        Q(n + j, n + j) = s.drive * s.drive;
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
    if (reached.head(F.rows() - C.rows())
            .isZero(0)) {  // a simulation: nothing but the sensors' own noise is to be learned
        MatrixXd P = MatrixXd::Zero(F.rows(), F.rows());
        for (Eigen::Index j = F.rows() - C.rows(), k = 0; j < F.rows(); ++j, ++k) {
            const double f = F(j, j), q = Q(j, j), r = R(k, k), b = r * (1.0 - f * f) - q;
            P(j, j) = 0.5 * (-b + std::sqrt(b * b + 4.0 * q * r));
        }
        return gain(P);
    }
    const VectorXd outputs = (C * s.asDiagonal()).rowwise().norm().cwiseMax(R.diagonal().cwiseSqrt());
    const MatrixXd own = outputs.cwiseInverse().asDiagonal();
    const MatrixXd inverse = s.cwiseInverse().asDiagonal();
    const Steady found = steady_covariance(scaled(F), inverse * Q * inverse, own * C * s.asDiagonal(), own * R * own);
    if (!found.converged) throw std::domain_error("kalman_gains: no steady gain; a state grows that no sensor sees");
    return gain(s.asDiagonal() * found.P * s.asDiagonal());
}

MatrixXd StateSpace::start(const VectorXd& s) const {
    const auto m = C.rows(), n = F.rows() - m;
    MatrixXd P = MatrixXd::Zero(F.rows(), F.rows());
    for (Eigen::Index k = 0; k < states_; ++k) P(k, k) = std::pow(unknown * s(k), 2);
    for (Eigen::Index k = states_; k < n + m; ++k) P(k, k) = Q(k, k) / std::max(1e-9, 1.0 - F(k, k) * F(k, k));
    return P;
}

MatrixXd StateSpace::next(const MatrixXd& P, const KalmanGains::Set& set) const {
    const MatrixXd after = P - set.K * (C * P);
    MatrixXd next = F * after * F.transpose() + Q;
    return 0.5 * (next + next.transpose());
}

}  // namespace innovations

KalmanGains kalman_gains(const Machine& machine, const SampledRecord& record, const NoiseModel& noise, double speed) {
    if (noise.sensors.size() != record.channels().size())
        throw std::invalid_argument("kalman_gains: " + std::to_string(noise.sensors.size()) + " noises for " +
                                    std::to_string(record.channels().size()) + " channels");
    std::vector<std::string> bodies;
    for (const auto& [body, torque] : noise.torque) bodies.push_back(body);
    innovations::Flow flow(machine, record, 1, bodies);
    KalmanGains gains;
    gains.noise = noise;
    for (unsigned pattern = 0; pattern < flow.patterns(); ++pattern) {
        const innovations::StateSpace space(flow, record, noise, pattern, speed);
        const Eigen::VectorXd scale = space.scale();
        if (pattern == flow.patterns() - 1) gains.scale = scale;
        gains.steady[pattern] = space.steady(scale);
    }
    return gains;
}

}  // namespace dualdrive
