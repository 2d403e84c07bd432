#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "../solvers/exact/generator.hpp"
#include "../solvers/exact/kernels.hpp"
#include "gain_schedule.hpp"
#include "reading.hpp"
#include "sensitivity.hpp"
#include "sensor_states.hpp"

namespace dualdrive {

namespace innovations {

namespace {

// Of a sensor's noise, by what a step of integration may bend. It stays in the state for many samples.
constexpr double bent = 1e-2;

std::vector<Flow::Output> outputs_of(const std::vector<Reading>& readings, const NoiseModel& noise) {
    std::vector<Flow::Output> outputs;
    for (std::size_t j = 0; j < readings.size(); ++j) {
        outputs.push_back({.late = readings[j].rest()});
        const double own = std::hypot(noise.sensors[j].drive, noise.sensors[j].white);
        if (own > 0.0) outputs.back().tolerance = bent * own;
    }
    return outputs;
}

// One record, sample by sample.
class Replay {
  public:
    Replay(const Machine& machine, const SampledRecord& record, KalmanGains& gains, const PredictionOptions& options,
           Sensitivities* changes = nullptr)
        : record_(record),
          options_(options),
          readings_(readings_of(machine, record)),
          sensors_(gains.noise),
          flow_(machine, record, options.substeps, gains.noise, outputs_of(readings_, gains.noise)),
          schedule_(machine, record, gains, options.learn, flow_),
          channels_(record.channels().size()),
          states_(static_cast<std::size_t>(flow_.states())),
          disturbances_(static_cast<std::size_t>(flow_.disturbance_count())),
          offsets_(options.offsets),
          changes_(changes) {
        if (changes_) flow_.hear_changes();
        if (offsets_.empty()) offsets_.assign(channels_, 0.0);
        if (offsets_.size() != channels_) throw std::invalid_argument("predict: one offset per channel");
        if (options.initial.size() > record.starts().size())
            throw std::invalid_argument("predict: more initial states than stretches");
        const std::size_t size = states_ + disturbances_ + sensors_.size();
        for (const auto& [pattern, set] : gains.steady)
            if (set[0].states != static_cast<Eigen::Index>(size))
                throw std::invalid_argument("predict: gains of a machine with other states");
        for (const auto& [body, torque] : gains.noise.torque) bodies_.push_back(body);
        for (const Autoregression& own : gains.noise.disturbances()) memory_.push_back(own.memory);
        e_.assign(channels_, 0.0);
        corrected_.assign(static_cast<std::size_t>(exact::padded(static_cast<int>(channels_ + size))), 0.0);
    }

    Prediction run() {
        make_room();
        for (std::size_t k = 0; k < record_.times().size() && out_.finite; ++k) {
            if (k == end_) begin(k);
            innovate(k);
            const KalmanGains::Set& gain = schedule_.at(flow_.phase(k));
            exact::kernels().multiply(static_cast<int>(corrected_.size()), static_cast<int>(channels_),
                                      gain.stacked.data(), static_cast<int>(channels_), e_.data(), 1,
                                      corrected_.data());
            if (!keep(k, gain)) return lost();
            if (changes_ && changes_->dear()) return lost();
            if (changes_) changes_->correct(k, outputs_, gain, counts(k));
            correct(k, gain);
            if (k + 1 < end_ && !go_on(k)) return lost();
        }
        out_.switches = flow_.switches();
        return std::move(out_);
    }

  private:
    double* moved() { return corrected_.data() + channels_; }  // K e

    Prediction lost() {
        out_.finite = false;
        return std::move(out_);
    }

    void make_room() {
        const std::size_t samples = record_.times().size();
        out_.states = flow_.layout().state_names;
        out_.bodies = bodies_;
        out_.residuals.assign(samples * channels_, Prediction::lost);
        if (!options_.states) return;
        out_.trajectory.assign(samples * states_, 0.0);
        out_.corrections.assign(samples * states_, 0.0);
        out_.torques.assign(samples * bodies_.size(), 0.0);
        out_.innovations.assign(samples * channels_, 0.0);
        out_.pattern.assign(samples, 0);
    }

    // A stretch.
    void begin(std::size_t k) {
        static const std::map<std::string, double> at_zero;
        const auto& initial = stretch_ < options_.initial.size() ? options_.initial[stretch_] : at_zero;
        begin_ = k;
        flow_.start(k, initial);
        if (changes_) changes_->begin(stretch_, k, flow_, initial);
        sensors_.forget();
        end_ = ++stretch_ < record_.starts().size() ? record_.starts()[stretch_] : record_.times().size();
        schedule_.begin(flow_.now().pattern, flow_.phase(k));
    }

    // e, what the sample tells that was not predicted. Of one whose reading comes after the stretch, nothing.
    void innovate(std::size_t k) {
        const double* const outputs = outputs_ = flow_.outputs(k);
        for (std::size_t j = 0; j < channels_; ++j) {
            const std::size_t row = k + readings_[j].shift();
            e_[j] = row < end_ ? record_.measured(row)[j] - offsets_[j] -
                                     readings_[j].read(record_.times()[k], outputs[j]) - sensors_.added(j)
                               : 0.0;
        }
    }

    // Whether what it leaves does.
    bool counts(std::size_t k) const { return k - begin_ >= static_cast<std::size_t>(options_.given); }

    // The whitened innovation. What is not known of the state at first costs a model with more states more: that is not held
    // against it.
    bool keep(std::size_t k, const KalmanGains::Set& gain) {
        const bool counted = counts(k);
        if (counted) out_.log_det += gain.log_det;
        for (std::size_t j = 0; j < channels_; ++j) {
            if (!std::isfinite(corrected_[j])) return false;
            out_.residuals[k * channels_ + j] = counted ? corrected_[j] : 0.0;
        }
        return true;
    }

    void correct(std::size_t k, const KalmanGains::Set& gain) {
        sensors_.flow(moved() + states_ + disturbances_);
        flow_.correct(k, gain, e_.data(), moved(), k - begin_ >= one_by_one);
        if (!options_.states) return;
        const auto row = static_cast<std::ptrdiff_t>(k);
        const auto put = [&](const double* from, std::size_t count, std::vector<double>& to) {
            std::copy_n(from, count, to.begin() + row * static_cast<std::ptrdiff_t>(count));
        };
        put(flow_.y(), states_, out_.trajectory);
        put(moved(), states_, out_.corrections);
        put(flow_.disturbances(), bodies_.size(), out_.torques);
        put(e_.data(), channels_, out_.innovations);
        out_.pattern[k] = static_cast<int>(flow_.now().contacts);
    }

    bool go_on(std::size_t k) {
        schedule_.depart(flow_.now().pattern, flow_.phase(k));
        if (changes_) changes_->depart(flow_);
        if (!flow_.flow(k)) return false;
        if (changes_) changes_->arrive(k + 1, flow_);
        for (std::size_t j = 0; j < disturbances_; ++j) flow_.disturbances()[j] *= memory_[j];
        return true;
    }

    const SampledRecord& record_;
    const PredictionOptions& options_;
    const std::vector<Reading> readings_;
    std::vector<std::string> bodies_;  // of the torques of unknown course
    SensorStates sensors_;
    Flow flow_;
    GainSchedule schedule_;
    const std::size_t channels_, states_, disturbances_;
    std::vector<double> offsets_, memory_;  // by channel; by disturbance
    std::vector<double> e_, corrected_;     // (r, K e)
    const double* outputs_ = nullptr;       // at the present sample
    Sensitivities* const changes_;          // null: nobody asks for them
    std::size_t stretch_ = 0, begin_ = 0, end_ = 0;
    Prediction out_;
};

}  // namespace

}  // namespace innovations

Prediction predict(const Machine& machine, const SampledRecord& record, KalmanGains& gains,
                   const PredictionOptions& options) {
    return innovations::Replay(machine, record, gains, options).run();
}

bool has_sensitivities(const Machine& machine, const SampledRecord& record) {
    return innovations::Sensitivities::told(innovations::Flow(machine, record, 1, NoiseModel{}),
                                            innovations::readings_of(machine, record));
}

std::vector<std::vector<double>> sensitivities(const Machine& machine, const SampledRecord& record, KalmanGains& gains,
                                               const PredictionOptions& options,
                                               const std::vector<Neighbour>& neighbours,
                                               const SensitivityOptions& how) {
    using namespace innovations;
    const auto readings = readings_of(machine, record);
    Sensitivities changes(machine, record, gains, neighbours, readings, options.offsets, how);
    if (changes.any() && !Replay(machine, record, gains, options, &changes).run().finite)
        return std::vector<std::vector<double>>(neighbours.size());
    return changes.found();
}

}  // namespace dualdrive
