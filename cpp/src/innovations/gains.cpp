#include "gains.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dualdrive {

bool NoiseModel::drifts() const {
    return std::any_of(sensors.begin(), sensors.end(), [](const SensorNoise& s) { return s.drift.drive > 0.0; });
}

bool NoiseModel::of_order_two() const {
    return std::any_of(sensors.begin(), sensors.end(), [](const SensorNoise& s) { return s.second != 0.0; });
}

namespace innovations {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr std::size_t short_while = 100;  // samples within which a state's typical size is reached
constexpr double forgotten = 100.0;       // s: see steady()
constexpr double unknown = 100.0;         // of that size: what is not known of the first state
constexpr int eighths = 3;                // of every octave, then: a power of two of pieces
constexpr std::size_t most_pieces = 400;
constexpr double settled_gain = 1e-7;  // difference of log det S per channel: the steady gain takes over unnoticed
constexpr double white_floor = 1e-3;   // of a sensor's drive: no reading is exact, and R has an inverse

// 1 − memory², by which a stationary variance is larger than what drives it.
double unforgotten(double memory) { return std::max(1e-9, 1.0 - memory * memory); }

}  // namespace

StateSpace::StateSpace(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern, double speed)
    : states_(flow.states()) {
    const Frozen frozen = flow.tangent(pattern, speed);
    const auto states = static_cast<Eigen::Index>(flow.states()), torques = Eigen::Index{flow.torque_count()},
               n = states + torques, m = static_cast<Eigen::Index>(record.channels().size());
    const Eigen::Index before = noise.of_order_two() ? m : 0, drifts = noise.drifts() ? m : 0;
    const Eigen::Index size = n + m + before + drifts;
    sensors_ = n;
    step_ = record.step();
    MatrixXd own = MatrixXd::Zero(size, size);  // what no tick changes
    Q = MatrixXd::Zero(size, size);
    C = MatrixXd::Zero(m, size);
    C.leftCols(states) = frozen.outputs.leftCols(states);
    C.middleCols(n, m) = MatrixXd::Identity(m, m);
    if (drifts) C.rightCols(m) = MatrixXd::Identity(m, m);
    stationary_ = MatrixXd::Zero(size, size);
    R = MatrixXd::Zero(m, m);
    for (Eigen::Index j = 0; j < m; ++j) {
        const SensorNoise& s = noise.sensors[static_cast<std::size_t>(j)];
        const Eigen::Index now = n + j, past = now + before, zero = now + before + m;
        own(now, now) = s.memory * (1.0 - s.second);
        Q(now, now) = s.drive * s.drive;
        const double variance = Q(now, now) / unforgotten(s.memory) / unforgotten(s.second);
        if (before) {
            own(now, past) = s.second;
            own(past, now) = 1.0;
            stationary_(past, past) = variance;
            stationary_(now, past) = stationary_(past, now) = s.memory * variance;
        }
        stationary_(now, now) = variance;
        if (drifts) {
            own(zero, zero) = s.drift.memory;
            Q(zero, zero) = s.drift.drive * s.drift.drive;
            stationary_(zero, zero) = Q(zero, zero) / unforgotten(s.drift.memory);
        }
        R(j, j) = s.white * s.white + white_floor * white_floor * s.drive * s.drive;
    }
    Eigen::Index b = states;
    for (const auto& [body, torque] : noise.torque) {
        own(b, b) = torque.memory;
        Q(b, b) = torque.drive * torque.drive;
        stationary_(b, b) = Q(b, b) / unforgotten(torque.memory);
        ++b;
    }
    for (std::size_t phase = 0; phase < flow.phases(); ++phase) {
        const MatrixXd flowed = flow.over_a_sample(frozen, phase);
        own.topLeftCorner(states, states) = flowed.topLeftCorner(states, states);
        own.block(0, states, states, torques) = flowed.block(0, flow.first_torque(), states, torques);
        F.push_back(own);
    }
}

VectorXd StateSpace::scale() const {
    MatrixXd reached = Q, power = F.front();  // of a period, then doubled: Σ Fᵏ Q F'ᵏ
    for (std::size_t phase = 1; phase < F.size(); ++phase) {
        reached = product(product(F[phase], reached), F[phase].transpose()) + Q;
        power = product(F[phase], power);
    }
    for (std::size_t k = F.size(); k < short_while; k *= 2) {
        reached += product(product(power, reached), power.transpose());
        power = product(power, power);
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

RiccatiDoubling StateSpace::doubling(const VectorXd& s, double kept) const {
    const VectorXd outputs = (C * s.asDiagonal()).rowwise().norm().cwiseMax(R.diagonal().cwiseSqrt());
    const MatrixXd own = outputs.cwiseInverse().asDiagonal(), inverse = s.cwiseInverse().asDiagonal();
    std::vector<MatrixXd> scaled;
    for (const MatrixXd& f : F) scaled.emplace_back(kept * (inverse * f * s.asDiagonal()));
    return {scaled, inverse * Q * inverse, own * C * s.asDiagonal(), own * R * own};
}

KalmanGains::Phased StateSpace::gains(MatrixXd P, std::size_t phase) const {
    KalmanGains::Phased found{std::vector<KalmanGains::Set>(F.size())};
    for (std::size_t k = 0; k < F.size(); ++k, phase = (phase + 1) % F.size()) {
        found.sets[phase] = gain(P);
        if (k + 1 < F.size()) P = next(P, found.sets[phase], phase);
    }
    return found;
}

KalmanGains::Phased StateSpace::steady() const {
    const VectorXd reached = scale(), s = (reached.array() > 0.0).select(reached, 1.0);
    if (Q.rows() == sensors_ + C.rows() && reached.head(sensors_).isZero(0)) {
        // a simulation: nothing but the sensors' own noise is to be learned
        MatrixXd P = MatrixXd::Zero(Q.rows(), Q.rows());
        for (Eigen::Index j = sensors_, k = 0; j < Q.rows(); ++j, ++k) {
            const double f = F.front()(j, j), q = Q(j, j), r = R(k, k), b = r * (1.0 - f * f) - q;
            P(j, j) = 0.5 * (-b + std::sqrt(b * b + 4.0 * q * r));
        }
        return {{gain(P)}};
    }
    // what nothing shows and nothing feels may walk away, as the difference of two slaves' equalisers does that both act on
    // the master: forgotten over minutes it stays finite, and no gain feels it
    Steady found = doubling(s, 1.0).steady();
    if (!found.converged) found = doubling(s, std::exp(-step_ / forgotten)).steady();
    if (!found.converged) throw std::domain_error("kalman_gains: no steady gain; a state grows that no sensor sees");
    return gains(s.asDiagonal() * found.P * s.asDiagonal(), 0);
}

StateSpace::Later::Later(const StateSpace& space)
    : scale_(space.scale().unaryExpr([](double x) { return x > 0.0 ? x : 1.0; })),
      doubling_(space.doubling(scale_, 1.0)) {}

MatrixXd StateSpace::Later::operator()(const MatrixXd& P, std::size_t phase, std::size_t samples) {
    const MatrixXd inverse = scale_.cwiseInverse().asDiagonal();
    return scale_.asDiagonal() * doubling_.after(inverse * P * inverse, phase, samples) * scale_.asDiagonal();
}

MatrixXd StateSpace::start(const VectorXd& deviation) const {
    MatrixXd P = stationary_;
    for (Eigen::Index k = 0; k < states_; ++k) P(k, k) = std::pow(deviation(k), 2);
    return P;
}

MatrixXd StateSpace::next(const MatrixXd& P, const KalmanGains::Set& set, std::size_t phase) const {
    const MatrixXd after = P - product(set.K, product(C, P));
    const MatrixXd next = product(product(F[phase], after), F[phase].transpose()) + Q;
    return 0.5 * (next + next.transpose());
}

FirstGains::FirstGains(const StateSpace& space, const VectorXd& deviation, std::size_t phase, KalmanGains::First& kept)
    : space_(space), later_(space), phase_(phase), kept_(kept) {
    if (kept_.P.size() == 0) kept_.P = space_.start(deviation);
}

void FirstGains::reach(std::size_t sample, const KalmanGains::Phased& steady) {
    auto& pieces = kept_.pieces;
    while (!kept_.settled && (pieces.empty() || pieces.back().end <= sample)) {
        const std::size_t begin = pieces.empty() ? 0 : pieces.back().end;
        const std::size_t length =
            begin < one_by_one ? 1 : std::size_t{1} << (std::ilogb(static_cast<double>(begin)) - eighths);
        const std::size_t middle = begin + length / 2, before = (phase_ + kept_.of) % space_.F.size();
        if (middle == kept_.of + 1)
            kept_.P = space_.next(kept_.P, pieces.back().sets[before], before);
        else if (middle > kept_.of)
            kept_.P = later_(kept_.P, before, middle - kept_.of);
        kept_.of = middle;
        const std::size_t phase = (phase_ + middle) % space_.F.size();
        auto sets = length == 1 ? KalmanGains::Phased{{space_.gain(kept_.P)}} : space_.gains(kept_.P, phase);
        const double away = std::abs(sets[phase].log_det - steady[phase].log_det);
        // the machine's tangent may grow beyond numbers
        kept_.settled = !(away > settled_gain * static_cast<double>(space_.C.rows())) || pieces.size() >= most_pieces;
        if (std::isfinite(away)) pieces.push_back({std::move(sets), begin + length});
    }
}

KalmanGains::Phased steady_gain(Flow& flow, const SampledRecord& record, const NoiseModel& noise, unsigned pattern,
                                double speed) {
    return StateSpace(flow, record, noise, pattern, speed).steady();
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
