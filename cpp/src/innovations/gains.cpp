#include "gains.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "../solvers/exact/kernels.hpp"
#include "dense.hpp"

namespace dualdrive {

bool NoiseModel::drifts() const {
    return std::any_of(sensors.begin(), sensors.end(), [](const SensorNoise& s) { return s.drift.drive > 0.0; });
}

bool NoiseModel::of_order_two() const {
    return std::any_of(sensors.begin(), sensors.end(), [](const SensorNoise& s) { return s.second != 0.0; });
}

std::vector<Autoregression> NoiseModel::disturbances() const {
    std::vector<Autoregression> found;
    for (const auto* all : {&torque, &creep})
        for (const auto& [body, noise] : *all) found.push_back(noise);
    return found;
}

bool KalmanGains::alike(const KalmanGains& other) const {
    if (elements != other.elements || carrying != other.carrying || at_first.size() != other.at_first.size() ||
        at_first != other.at_first)
        return false;
    for (const auto& [pattern, own] : steady) {
        const auto found = other.steady.find(pattern);
        if (found == other.steady.end()) continue;
        const auto& others = found->second.sets;
        const auto same = [](const Set& a, const Set& b) {
            return a.states == b.states && a.stacked.cols() == b.stacked.cols() && a.stacked == b.stacked;
        };
        if (!std::equal(own.sets.begin(), own.sets.end(), others.begin(), others.end(), same)) return false;
    }
    return true;
}

void KalmanGains::begin_as(const KalmanGains& other) {
    sojourns.clear();
    first.clear();
    for (const auto& [begin, index] : other.first) {
        first[begin] = sojourns.size();
        sojourns.push_back(other.sojourns[index]);
        sojourns.back().exits.clear();
    }
    steady.insert(other.steady.begin(), other.steady.end());
}

namespace innovations {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr std::size_t short_while = 100;  // samples within which a state's typical size is reached
constexpr double forgotten = 100.0;       // s: see steady()
constexpr double unknown = 100.0;         // of that size: what is not known of the first state
constexpr double white_floor = 1e-3;      // of a sensor's drive: no reading is exact, and R has an inverse

// L of a positive definite L L', not a number where there is none. Of a few rows, for which a library's calls cost more.
MatrixXd lower_factor(MatrixXd A) {
    const Eigen::Index n = A.rows();
    for (Eigen::Index j = 0; j < n; ++j) {
        for (Eigen::Index k = 0; k < j; ++k)
            for (Eigen::Index i = j; i < n; ++i) A(i, j) -= A(i, k) * A(j, k);
        const double pivot = std::sqrt(A(j, j));
        for (Eigen::Index i = j; i < n; ++i) A(i, j) /= pivot;
        for (Eigen::Index i = 0; i < j; ++i) A(i, j) = 0.0;
    }
    return A;
}

MatrixXd lower_inverse(const MatrixXd& L) {
    const Eigen::Index n = L.rows();
    MatrixXd inverse = MatrixXd::Zero(n, n);
    for (Eigen::Index j = 0; j < n; ++j) {
        inverse(j, j) = 1.0 / L(j, j);
        for (Eigen::Index i = j + 1; i < n; ++i) {
            double sum = 0.0;
            for (Eigen::Index k = j; k < i; ++k) sum -= L(i, k) * inverse(k, j);
            inverse(i, j) = sum / L(i, i);
        }
    }
    return inverse;
}

// 1 − memory², by which a stationary variance is larger than what drives it.
double unforgotten(double memory) { return std::max(1e-9, 1.0 - memory * memory); }

}  // namespace

void write_memories(const NoiseModel& noise, Eigen::Index first, MatrixXd& F) {
    const auto m = static_cast<Eigen::Index>(noise.sensors.size());
    const Eigen::Index before = noise.of_order_two() ? m : 0;
    for (const Autoregression& own : noise.disturbances()) {
        F(first, first) = own.memory;
        ++first;
    }
    for (Eigen::Index j = 0; j < m; ++j) {
        const SensorNoise& s = noise.sensors[static_cast<std::size_t>(j)];
        const Eigen::Index now = first + j, past = now + before, zero = now + before + m;
        F(now, now) = s.memory * (1.0 - s.second);
        if (before) {
            F(now, past) = s.second;
            F(past, now) = 1.0;
        }
        if (noise.drifts()) F(zero, zero) = s.drift.memory;
    }
}

StateSpace::StateSpace(Flow& flow, const SampledRecord& record, const NoiseModel& noise, const Modes& pattern,
                       double speed)
    : states_(flow.states()), step_(record.step()) {
    Frozen frozen = flow.tangent(pattern, speed);
    const auto disturbances = Eigen::Index{flow.disturbance_count()}, n = states_ + disturbances,
               m = static_cast<Eigen::Index>(record.channels().size());
    const Eigen::Index before = noise.of_order_two() ? m : 0, drifts = noise.drifts() ? m : 0;
    const Eigen::Index size = n + m + before + drifts;
    sensors_ = n;
    MatrixXd F = MatrixXd::Zero(size, size);
    write_memories(noise, states_, F);
    Q_ = MatrixXd::Zero(size, size);
    C_ = MatrixXd::Zero(m, size);
    C_.leftCols(states_) = frozen.outputs.leftCols(states_);
    C_.middleCols(n, m) = MatrixXd::Identity(m, m);
    if (drifts) C_.rightCols(m) = MatrixXd::Identity(m, m);
    stationary_ = MatrixXd::Zero(size, size);
    R_ = MatrixXd::Zero(m, m);
    for (Eigen::Index j = 0; j < m; ++j) {
        const SensorNoise& s = noise.sensors[static_cast<std::size_t>(j)];
        const Eigen::Index now = n + j, past = now + before, zero = now + before + m;
        Q_(now, now) = s.drive * s.drive;
        const double variance = Q_(now, now) / unforgotten(s.memory) / unforgotten(s.second);
        if (before) {
            stationary_(past, past) = variance;
            stationary_(now, past) = stationary_(past, now) = s.memory * variance;
        }
        stationary_(now, now) = variance;
        if (drifts) {
            Q_(zero, zero) = s.drift.drive * s.drift.drive;
            stationary_(zero, zero) = Q_(zero, zero) / unforgotten(s.drift.memory);
        }
        R_(j, j) = s.white * s.white + white_floor * white_floor * s.drive * s.drive;
    }
    Eigen::Index b = states_;
    for (const Autoregression& own : noise.disturbances()) {
        Q_(b, b) = own.drive * own.drive;
        stationary_(b, b) = Q_(b, b) / unforgotten(own.memory);
        ++b;
    }
    for (Eigen::Index j = states_; j < size; ++j)
        for (Eigen::Index i = states_; i < size; ++i)
            if (F(i, j) != 0.0) own_.push_back({i - states_, j - states_, F(i, j)});
    for (std::size_t phase = 0; phase < flow.phases(); ++phase) {
        const MatrixXd flowed = flow.over_a_sample(frozen, phase);
        F.topLeftCorner(states_, states_) = flowed.topLeftCorner(states_, states_);
        F.block(0, states_, states_, disturbances) = flowed.block(0, flow.first_disturbance(), states_, disturbances);
        F_.push_back(F);
        const MatrixXd rows = F.topLeftCorner(states_, n);
        moved_.push_back({padded_rows(rows), rows.transpose()});
    }
    if (drifts) zeros_ = size - m;
    seen_ = C_.leftCols(states_).transpose();
    const MatrixXd room = padded_rows(MatrixXd::Zero(states_, size));
    shown_ = gained_ = padded_rows(MatrixXd::Zero(size, m));
    across_ = room;
    back_ = room.leftCols(states_);
    half_ = MatrixXd::Zero(size - states_, size - states_);
}

const VectorXd& StateSpace::scale() {
    if (scale_.size() == 0) scale_ = reached();
    return scale_;
}

const VectorXd& StateSpace::units() {
    if (units_.size() == 0) units_ = (scale().array() > 0.0).select(scale(), 1.0);
    return units_;
}

VectorXd StateSpace::reached() const {
    MatrixXd reached = Q_, power = F_.front();  // of a period, then doubled: Σ Fᵏ Q F'ᵏ
    for (std::size_t phase = 1; phase < F_.size(); ++phase) {
        reached = product(product(F_[phase], reached), F_[phase].transpose()) + Q_;
        power = product(F_[phase], power);
    }
    for (std::size_t k = F_.size(); k < short_while; k *= 2) {
        reached += product(product(power, reached), power.transpose());
        power = product(power, power);
    }
    return reached.diagonal().cwiseMax(0.0).cwiseSqrt();
}

KalmanGains::Set StateSpace::gain(const MatrixXd& P) {
    const auto rows = static_cast<int>(P.rows()), n = static_cast<int>(states_), m = static_cast<int>(C_.rows());
    MatrixXd& PC = shown_;  // P C'
    exact::kernels().product(rows, n, P.data(), n, seen_.data(), m, PC.data());
    for (Eigen::Index j = 0; j < m; ++j) {
        PC.col(j) += P.col(sensors_ + j);
        if (zeros_) PC.col(j) += P.col(zeros_ + j);
    }
    MatrixXd S = R_;
    for (Eigen::Index j = 0; j < m; ++j)
        for (Eigen::Index i = j; i < m; ++i) {
            S(i, j) += seen_.col(i).dot(PC.col(j).head(n)) + PC(sensors_ + i, j);
            if (zeros_) S(i, j) += PC(zeros_ + i, j);
        }
    const MatrixXd whitening = lower_inverse(lower_factor(S));
    const MatrixXd inverse = whitening.transpose().lazyProduct(whitening);
    exact::kernels().product(rows, m, PC.data(), m, inverse.data(), m, gained_.data());
    KalmanGains::Set set;
    set.states = size();
    set.stacked = MatrixXd::Zero(exact::padded(static_cast<int>(m + size())), m);
    set.stacked.topRows(m) = whitening;
    set.stacked.middleRows(m, size()) = gained_.topRows(size());
    set.log_det = -2.0 * whitening.diagonal().array().log().sum();
    return set;
}

RiccatiDoubling StateSpace::doubling(double kept) {
    const VectorXd& s = units();
    const VectorXd outputs = (C_ * s.asDiagonal()).rowwise().norm().cwiseMax(R_.diagonal().cwiseSqrt());
    const MatrixXd own = outputs.cwiseInverse().asDiagonal(), inverse = s.cwiseInverse().asDiagonal();
    std::vector<MatrixXd> scaled;
    for (const MatrixXd& f : F_) scaled.emplace_back(kept * (s.cwiseInverse().asDiagonal() * f * s.asDiagonal()));
    return {scaled, inverse * Q_ * inverse, own * C_ * s.asDiagonal(), own * R_ * own};
}

RiccatiDoubling& StateSpace::horizon() {
    if (!horizon_) horizon_ = std::make_unique<RiccatiDoubling>(doubling(1.0));
    return *horizon_;
}

KalmanGains::Phased StateSpace::gains(MatrixXd P, std::size_t phase) {
    KalmanGains::Phased found{std::vector<KalmanGains::Set>(F_.size())};
    for (std::size_t k = 0; k < F_.size(); ++k, phase = (phase + 1) % F_.size()) {
        found.sets[phase] = gain(P);
        if (k + 1 < F_.size()) next(P, found.sets[phase], phase);
    }
    return found;
}

MatrixXd StateSpace::steady_covariance() {
    if (Q_.rows() == sensors_ + C_.rows() && scale().head(sensors_).isZero(0)) {
        // a simulation: nothing but the sensors' own noise is to be learned
        MatrixXd P = MatrixXd::Zero(Q_.rows(), Q_.rows());
        for (Eigen::Index j = sensors_, k = 0; j < Q_.rows(); ++j, ++k) {
            const double f = F_.front()(j, j), q = Q_(j, j), r = R_(k, k), b = r * (1.0 - f * f) - q;
            P(j, j) = 0.5 * (-b + std::sqrt(b * b + 4.0 * q * r));
        }
        return padded_rows(P);
    }
    // what nothing shows and nothing feels may walk away, as the difference of two slaves' equalisers does that both act on
    // the master: forgotten over minutes it stays finite, and no gain feels it
    Steady found = horizon().steady();
    if (!found.converged) found = doubling(std::exp(-step_ / forgotten)).steady();
    if (!found.converged) throw std::domain_error("kalman_gains: no steady gain; a state grows that no sensor sees");
    return padded_rows(units().asDiagonal() * found.P * units().asDiagonal());
}

MatrixXd StateSpace::later(const MatrixXd& P, std::size_t periods) {
    const VectorXd& s = units();
    const MatrixXd scaled = s.cwiseInverse().asDiagonal() * P.topRows(size()) * s.cwiseInverse().asDiagonal();
    return padded_rows(s.asDiagonal() * horizon().after(scaled, periods) * s.asDiagonal());
}

MatrixXd StateSpace::start(const VectorXd& deviation) const {
    MatrixXd P = stationary_;
    for (Eigen::Index k = 0; k < states_; ++k) P(k, k) = std::pow(deviation(k), 2);
    return padded_rows(P);
}

// F (P − B B') F' + Q by blocks, K = B W: what is no state of the machine moves by `own_` alone.
void StateSpace::next(MatrixXd& P, const KalmanGains::Set& set, std::size_t phase) {
    const Eigen::Index n = states_, torqued = sensors_, rest = size() - n;
    const exact::Kernels& kernels = exact::kernels();
    const auto rows = static_cast<int>(P.rows()), m = static_cast<int>(C_.rows());
    const MatrixXd factor = lower_inverse(set.whitening());
    gained_.topRows(size()) = set.K();
    MatrixXd &B = shown_, &minus = gained_, &across = across_, &back = back_;
    kernels.product(rows, m, gained_.data(), m, factor.data(), m, B.data());
    minus = -B;
    kernels.add_outer(rows, static_cast<int>(size()), m, minus.data(), rows, B.data(), P.data());
    const auto& [moved, transposed] = moved_[phase];
    const auto tall = static_cast<int>(moved.rows());
    kernels.product(tall, static_cast<int>(torqued), moved.data(), rows, P.data(), static_cast<int>(size()),
                    across.data());
    kernels.product(tall, static_cast<int>(torqued), across.data(), static_cast<int>(torqued), transposed.data(),
                    static_cast<int>(n), back.data());
    half_.setZero();
    for (const auto& [i, j, f] : own_) half_.col(i) += f * P.col(n + j).segment(n, rest);
    P.topRows(size()) = Q_;
    for (Eigen::Index j = 0; j < n; ++j)
        for (Eigen::Index i = 0; i < n; ++i) P(i, j) += 0.5 * (back(i, j) + back(j, i));
    for (const auto& [i, j, f] : own_) P.col(n + i).head(n) += f * across.col(n + j).head(n);
    for (Eigen::Index c = 0; c < rest; ++c)
        for (const auto& [i, j, f] : own_)
            if (i >= c) P(n + i, n + c) += f * half_(j, c);
    for (Eigen::Index j = n; j < size(); ++j)
        for (Eigen::Index i = 0; i < j; ++i) {
            if (i < n)
                P(j, i) = P(i, j);
            else
                P(i, j) = P(j, i);
        }
}

}  // namespace innovations

std::vector<std::string> held_by_friction(const Machine& machine) {
    const Inputs none;
    const Layout layout(machine, none);
    std::vector<std::string> found;
    std::vector<bool> seen(static_cast<std::size_t>(layout.groups), false);
    for (std::size_t b = 0; b < machine.bodies().size(); ++b) {
        const auto g = static_cast<std::size_t>(layout.group_of[b]);
        if (layout.stick_of[g] >= 0 && !seen[g]) found.push_back(machine.bodies()[b].name);
        seen[g] = true;
    }
    return found;
}

KalmanGains kalman_gains(const Machine& machine, const SampledRecord& record, const NoiseModel& noise, double speed,
                         const FirstState& first) {
    if (noise.sensors.size() != record.channels().size())
        throw std::invalid_argument("kalman_gains: " + std::to_string(noise.sensors.size()) + " noises for " +
                                    std::to_string(record.channels().size()) + " channels");
    innovations::Flow flow(machine, record, 1, noise);
    KalmanGains gains;
    gains.noise = noise;
    gains.speed = speed;
    gains.elements = flow.elements();
    gains.carrying = flow.carrying();
    gains.steady[gains.carrying] = innovations::StateSpace(flow, record, noise, gains.carrying, speed).steady();
    NoiseModel wide = noise;
    for (const auto& [body, torque] : first.torque)
        if (wide.torque.contains(body)) wide.torque[body] = torque;
    gains.at_first = innovations::unknown * innovations::StateSpace(flow, record, wide, gains.carrying, speed).scale();
    // What a law remembers of a motion before the record is no more than where the body slides on, ż = a ω − b z = 0: a bristle
    // that a first correction bends further pulls as no friction does.
    if (!flow.layout().memories.empty()) {
        const innovations::Frozen slides = flow.tangent(gains.carrying, speed);
        for (const auto& memory : flow.layout().memories) {
            const int group = flow.layout().group_of[static_cast<std::size_t>(memory.body)];
            const double relaxes = -slides.A(memory.state, memory.state);
            const double most = std::abs(slides.A(memory.state, group) * speed);
            if (gains.at_first(memory.state) * relaxes > most) gains.at_first(memory.state) = most / relaxes;
        }
    }
    for (const auto& [name, deviation] : first.deviation)
        if (const int k = flow.layout().state(name); k >= 0)
            gains.at_first(k) = std::hypot(gains.at_first(k), deviation);
    return gains;
}

LinearFilter linear_filter(const Machine& machine, const SampledRecord& record, const KalmanGains& gains) {
    innovations::Flow flow(machine, record, 1, gains.noise);
    const innovations::StateSpace space(flow, record, gains.noise, gains.carrying, gains.speed);
    return {space.F(), space.C(), Eigen::Index{flow.states()}};
}

}  // namespace dualdrive
