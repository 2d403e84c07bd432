#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "../solvers/exact/generator.hpp"
#include "dualdrive/effects.hpp"
#include "dualdrive/recorder.hpp"
#include "gain_schedule.hpp"

namespace dualdrive {

namespace {

// What becomes of a signal on its way into the record; the delay's whole samples shift the record, the rest goes along the
// signal's own slope and curvature, so that a residual is smooth in it.
class Reading {
  public:
    Reading(const Machine& machine, const SampledRecord& record, std::size_t channel)
        : effects_(reading_effects(machine, record.channels()[channel].places)),
          measures_(record.channels()[channel].name.starts_with("theta_") ? Measures::angle : Measures::other) {
        double late = 0.0;
        for (const auto& effect : effects_) late += effect->delay();
        shift_ = static_cast<std::size_t>(std::max(0.0, std::round(late / record.step())));
        rest_ = late - static_cast<double>(shift_) * record.step();
    }
    std::size_t shift() const { return shift_; }
    bool plain() const { return effects_.empty(); }
    // How much earlier than the state it is, s: less than a sample.
    double rest() const { return rest_; }
    // value, slope and curvature of the signal at the time of the state; the reading `shift` samples later.
    double read(double t, double value, double slope, double curvature) const {
        double y = value - rest_ * slope + 0.5 * rest_ * rest_ * curvature;
        for (const auto& effect : effects_) y = effect->reading(y, {t, measures_});
        return y;
    }

  private:
    std::vector<std::unique_ptr<Effect<double>>> effects_;
    Measures measures_;
    std::size_t shift_ = 0;
    double rest_ = 0.0;
};

}  // namespace

Prediction predict(const Machine& machine, const SampledRecord& record, KalmanGains& gains,
                   const PredictionOptions& options) {
    using Vector = Eigen::VectorXd;
    using Map = Eigen::Map<const Vector>;
    std::vector<std::string> bodies;
    std::vector<double> memory;
    for (const auto& [body, torque] : gains.noise.torque) {
        bodies.push_back(body);
        memory.push_back(torque.memory);
    }
    innovations::Flow flow(machine, record, options.substeps, bodies);
    const auto states = static_cast<Eigen::Index>(flow.states()), torques = Eigen::Index{flow.torque_count()},
               n = states + torques, m = static_cast<Eigen::Index>(record.channels().size());
    const auto samples = record.times().size();
    if (!options.offsets.empty() && options.offsets.size() != static_cast<std::size_t>(m))
        throw std::invalid_argument("predict: one offset per channel");
    const Eigen::Index before = gains.noise.of_order_two() ? m : 0, drifts = gains.noise.drifts() ? m : 0;
    const Eigen::Index size = n + m + before + drifts;
    for (const auto& [pattern, set] : gains.steady)
        if (set[0].K.rows() != size) throw std::invalid_argument("predict: gains of a machine with other states");

    Prediction out;
    out.states = flow.layout().state_names;
    out.bodies = bodies;
    out.residuals.assign(samples * static_cast<std::size_t>(m), Prediction::lost);
    if (options.states) {
        out.trajectory.assign(samples * static_cast<std::size_t>(states), 0.0);
        out.corrections.assign(samples * static_cast<std::size_t>(states), 0.0);
        out.torques.assign(samples * static_cast<std::size_t>(torques), 0.0);
        out.innovations.assign(samples * static_cast<std::size_t>(m), 0.0);
        out.pattern.assign(samples, 0);
    }
    std::vector<Reading> readings;
    bool plain = true, late = false;
    for (std::size_t j = 0; j < static_cast<std::size_t>(m); ++j) {
        readings.emplace_back(machine, record, j);
        plain = plain && readings.back().plain();
        late = late || readings.back().rest() != 0.0;
    }
    const Vector offsets = options.offsets.empty() ? Vector::Zero(m) : Vector(Map(options.offsets.data(), m));

    if (options.initial.size() > record.starts().size())
        throw std::invalid_argument("predict: more initial states than stretches");
    const std::map<std::string, double> at_zero;
    Vector noise = Vector::Zero(m), past = noise, drift = Vector::Zero(m), e(m), r(m), output(m), correction(size);
    innovations::GainSchedule schedule(machine, record, gains, options.learn, flow);
    std::size_t stretch = 0, begin = 0, end = 0;
    for (std::size_t k = 0; k < samples; ++k) {
        if (k == end) {
            begin = k;
            flow.start(k, stretch < options.initial.size() ? options.initial[stretch] : at_zero);
            noise.setZero();
            past.setZero();
            drift.setZero();
            end = ++stretch < record.starts().size() ? record.starts()[stretch] : samples;
            schedule.begin(flow.now().pattern, flow.phase(k));
        }
        innovations::Frozen* now = &flow.now();
        flow.outputs(output.data());
        if (!plain) {
            const Map y(flow.arriving(k), now->A.rows());
            const Vector rate = now->A * y, curvature = now->A * rate;
            const Vector slopes = now->outputs * rate, bends = now->outputs * curvature;
            for (Eigen::Index j = 0; j < m; ++j)
                output(j) =
                    readings[static_cast<std::size_t>(j)].read(record.times()[k], output(j), slopes(j), bends(j));
        }
        for (Eigen::Index j = 0; j < m; ++j) {
            const std::size_t row = k + readings[static_cast<std::size_t>(j)].shift();
            e(j) = row < end ? record.measured(row)[j] - offsets(j) - output(j) - noise(j) - drift(j) : 0.0;
        }
        const auto [set, steady] = schedule.at(now->pattern, flow.phase(k));
        r.noalias() = set.whitening * e;
        // what is not known of the state at first costs a model with more states more: that is not held against it
        const bool counts = k - begin >= static_cast<std::size_t>(options.given);
        if (counts) out.log_det += set.log_det;
        correction.noalias() = set.K * e;
        // A reading of a moment before tells of the state then: what it corrects there has flowed on since. Corrections of
        // the present by what is late by half a sample would swing up under gains that hardly trust the model.
        for (Eigen::Index j = 0; late && j < m; ++j) {
            const double rest = readings[static_cast<std::size_t>(j)].rest();
            if (rest == 0.0) continue;
            Vector there = Vector::Zero(now->A.rows());
            there.head(states) = e(j) * set.K.col(j).head(states);
            there.segment(flow.first_torque(), torques) = e(j) * set.K.col(j).segment(states, torques);
            const Vector rate = now->A * there, curvature = now->A * rate;
            correction.head(states) += rest * (rate + 0.5 * rest * curvature).head(states);
        }
        for (Eigen::Index j = 0; j < m; ++j) {
            const double value = r(j);
            if (!std::isfinite(value)) {
                out.finite = false;
                return out;
            }
            out.residuals[k * static_cast<std::size_t>(m) + static_cast<std::size_t>(j)] = counts ? value : 0.0;
        }
        for (Eigen::Index j = 0; j < m; ++j) {
            const SensorNoise& sensor = gains.noise.sensors[static_cast<std::size_t>(j)];
            noise(j) += correction(n + j);
            if (before) past(j) += correction(n + m + j);
            past(j) =
                std::exchange(noise(j), sensor.memory * (1.0 - sensor.second) * noise(j) + sensor.second * past(j));
            if (drifts) drift(j) = sensor.drift.memory * (drift(j) + correction(n + before + m + j));
        }
        for (Eigen::Index j = 0; j < torques; ++j) flow.torques()[j] += correction(states + j);
        flow.correct(k, set.K, e.data(), correction.data(), k - begin >= innovations::one_by_one, steady && !late);
        if (options.states) {
            const auto row = static_cast<std::ptrdiff_t>(k);
            std::copy_n(flow.y(), states, out.trajectory.begin() + row * states);
            std::copy_n(correction.data(), states, out.corrections.begin() + row * states);
            std::copy_n(flow.torques(), torques, out.torques.begin() + row * torques);
            std::copy_n(e.data(), m, out.innovations.begin() + static_cast<std::ptrdiff_t>(k) * m);
            out.pattern[k] = static_cast<int>(flow.now().contacts);
        }
        if (k + 1 == end) continue;
        schedule.depart(flow.now().pattern, flow.phase(k));
        if (!flow.flow(k)) {
            out.finite = false;
            return out;
        }
        for (Eigen::Index j = 0; j < torques; ++j) flow.torques()[j] *= memory[static_cast<std::size_t>(j)];
    }
    out.switches = flow.switches();
    return out;
}

}  // namespace dualdrive
