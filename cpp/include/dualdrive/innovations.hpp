// Innovations of a record: what each sample tells that the model, pulled back to the samples before, had not predicted.
//
// The machine is a stochastic grey box (Kristensen, Madsen, Jørgensen, Automatica 40 (2004) 225–237): its own equations with
// all their switches, driven besides by torques d of unknown course, one per equation, and by the speeds at which bodies creep
// that dry friction holds (none is so dry that nothing moves), all of them states of the filter; and
// sensors with noise that has a memory. Between samples the state flows as it does in a simulation; at a sample it is
// corrected by the gain of an extended Kalman filter, whose covariance P goes along through every change of the modes
// (Jazwinski, Stochastic Processes and Filtering Theory, 1970, §8.3):
//
//   e_k = y_k − h(z⁻_k) − n⁻_k,   (z_k, d_k, n_k) = (z⁻_k, d⁻_k, n⁻_k) + K_s e_k,   r_k = S_s^(−1/2) e_k
//
// r is white with variance 1 if the model and the noise are right (Ljung, System Identification, 2nd ed., §7.4). With no
// torque of unknown course K moves the sensors' noise alone: the replay is then a simulation of the whole record.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "dualdrive/machine.hpp"
#include "dualdrive/signal.hpp"
#include "dualdrive/switching.hpp"

namespace dualdrive {

namespace exact {
class Generator;
}

// An autoregression of order one: n_{k+1} = memory · n_k + drive · white noise.
struct Autoregression {
    double drive, memory;
};

// A sensor's noise: an autoregression, white noise `white` on top, of its rounding say, and a zero that drifts. Of order two
// by its partial autocorrelations `memory` and `second`, each within ±1 where it is stationary (Monahan, Biometrika 71 (1984)
// 403–404): n_{k+1} = memory (1 − second) n_k + second n_{k−1} + drive · white noise.
struct SensorNoise {
    double drive, memory, white;
    double second = 0.0;
    Autoregression drift = {0.0, 0.0};
};

// A torque of unknown course, constant over a sample, N·m in its body's own frame.
using TorqueNoise = Autoregression;

struct NoiseModel {
    std::vector<SensorNoise> sensors;                  // per channel
    std::map<std::string, TorqueNoise> torque;         // by body
    std::map<std::string, Autoregression> creep = {};  // by body: its speed while dry friction holds it, rad/s
    bool drifts() const;                               // whether any sensor's zero does
    bool of_order_two() const;                         // whether any sensor's autoregression is
    // Torques of unknown course, then speeds of creep, by body: states of the filter in this order.
    std::vector<Autoregression> disturbances() const;
};

// Bodies that dry friction may hold, one of each that turn together.
std::vector<std::string> held_by_friction(const Machine& machine);

// A record, or stretches of one end to end: times about evenly spaced, what was commanded, and what the sensors said.
class SampledRecord {
  public:
    struct Channel {
        std::string name;                 // a signal of the machine
        std::vector<std::string> places;  // where effects change its reading, in this order
    };

    // measured: times × channels, row-major. Throws std::invalid_argument for lengths that differ, fewer than two samples,
    // or times that do not increase.
    SampledRecord(Inputs inputs, std::vector<double> times, std::vector<Channel> channels,
                  std::vector<double> measured);

    const Inputs& inputs() const { return inputs_; }
    const exact::Generator& generator() const { return *generator_; }
    const std::vector<double>& times() const { return times_; }
    double step() const { return step_; }    // distance of the times, by least squares
    double begin() const { return begin_; }  // of the whole record: from there on sampled loops tick
    const std::vector<Channel>& channels() const { return channels_; }
    const double* measured(std::size_t sample) const { return measured_.data() + sample * channels_.size(); }
    // States of the inputs' generator from a sample on.
    const double* generator_states(std::size_t sample) const;
    // Samples at which a stretch begins, the first one among them.
    const std::vector<std::size_t>& starts() const { return starts_; }
    // Stretches of it, (first sample, how many), end to end. Throws std::invalid_argument for none, for fewer than two
    // samples in one, or beyond the end.
    SampledRecord stretches(const std::vector<std::pair<std::size_t, std::size_t>>& which) const;

  private:
    SampledRecord() = default;
    Inputs inputs_;
    std::shared_ptr<const exact::Generator> generator_;
    std::vector<double> times_, measured_, generator_states_;
    std::vector<Channel> channels_;
    std::vector<std::size_t> starts_ = {0};
    double step_ = 0.0, begin_ = 0.0;
};

// The gains of an extended Kalman filter along a record, and what is needed to go on with them.
//
// A tangent belongs to a pattern of modes: which meshes carry, what rests, which limits are met. While it holds, gains are
// those of a linear system and can be worked out beforehand; where it changes, the covariance goes on from what it had become.
// So they are kept by sojourn: a stay in one pattern, from the covariance with which it began. The first ones of a stretch
// begin with what is not known of its state; all others where another one was left. A replay under other numbers that leaves
// a sojourn a sample sooner or later takes the gains of the nearest that is known, so that residuals change smoothly with the
// numbers. Elements that their machine lacks, such as the friction of a law that is tried, do not count for a replay that
// does not learn: gains are held where a law is scored.
struct KalmanGains {
    struct Set {
        // S^(−1/2) above K, and rows of zeros below as the kernels want them: one product with an innovation tells all.
        Eigen::MatrixXd stacked;
        Eigen::Index states = 0;  // rows of K
        double log_det = 0.0;     // log det S
        // (states + disturbances + channels, again where of order two, again where zeros drift) × channels
        auto K() const { return stacked.middleRows(stacked.cols(), states); }
        auto whitening() const { return stacked.topRows(stacked.cols()); }  // S^(−1/2), lower triangular
    };
    // By the phase of a sample between the ticks of sampled loops; one set where it serves all.
    struct Phased {
        std::vector<Set> sets;
        const Set& operator[](std::size_t phase) const {
            return sets.size() == 1 ? sets[0] : sets[phase % sets.size()];
        }
    };
    struct Piece {
        Phased sets;
        std::size_t end = 0;  // samples after the first of the sojourn: till there they serve
    };
    struct Exit {
        std::size_t age = 0;   // samples after the first, of the last sample before another pattern
        Modes pattern;         // that one
        std::size_t next = 0;  // sojourn that follows
    };
    struct Sojourn {
        Modes pattern;
        std::size_t phase = 0;  // of its first sample
        Eigen::MatrixXd begin;  // covariance of the state before its first sample
        Eigen::MatrixXd P;      // and before the sample `of`, where the pieces go on
        std::size_t of = 0;     // samples after the first
        bool settled = false;   // the steady gains serve from the end of the pieces on
        std::vector<Piece> pieces;
        std::vector<Exit> exits;
    };
    using Begin = std::pair<Modes, std::size_t>;  // pattern, and phase of a stretch's first sample
    NoiseModel noise;
    Eigen::VectorXd at_first;           // standard deviation of what is not known of each state at the first sample
    double speed = 0.0;                 // table speed about which laws that are not affine are linearised, rad/s
    std::vector<std::string> elements;  // of the patterns: switches of the machine
    Modes carrying;                     // the pattern in which all meshes carry, nothing rests and no limit is met
    std::map<Modes, Phased> steady;
    std::vector<Sojourn> sojourns;
    std::map<Begin, std::size_t> first;  // those with which stretches begin

    // Whether these are the gains of the other's machine bit by bit, as far as both are known: settings of a record that
    // no tangent feels, as its tension, make no difference.
    bool alike(const KalmanGains& other) const;
    // Takes over how another's stretches begin, and its steady gains.
    void begin_as(const KalmanGains& other);
};

// What is not known of the state at the first sample: where torques of unknown course of this size would take it, and, by
// state, a standard deviation besides.
struct FirstState {
    std::map<std::string, TorqueNoise> torque;  // by body; empty: those of the noise model
    std::map<std::string, double> deviation;
};

// The gains of the machine's tangents about motion at table speed `speed`, rad/s: the steady ones where all meshes carry; all
// others are learned along a record. Throws std::domain_error where the Riccati equation has no solution: a state that grows
// and that no sensor sees.
KalmanGains kalman_gains(const Machine& machine, const SampledRecord& record, const NoiseModel& noise, double speed,
                         const FirstState& first = {});

// x_{k+1} = F x_k + K e_k before a measurement, y_k = C x_k + e_k, e_k = S^(1/2) r_k: the machine's tangent where all meshes
// carry, nothing rests and no limit is met, its sensors' noise and torques of unknown course included.
struct LinearFilter {
    std::vector<Eigen::MatrixXd> F;  // by phase of the ticks of sampled loops
    Eigen::MatrixXd C;               // channels × (states, disturbances, and what sensors remember)
    Eigen::Index states;             // of the machine: first of those
};

// About the same motion as the gains, of whose machine it is.
LinearFilter linear_filter(const Machine& machine, const SampledRecord& record, const KalmanGains& gains);

struct PredictionOptions {
    // per stretch: state name -> value at its first sample; all others 0, and those of stretches without an entry
    std::vector<std::map<std::string, double>> initial;
    std::vector<double> offsets;  // per channel: what the sensor adds; empty: nothing
    int substeps = 1;             // per sample, where a law is not affine
    int given = 0;                // first samples of a stretch that the likelihood is conditioned on: they do not count
    bool states = false;          // keep states, corrections, torques and contacts
    bool learn = false;           // what `gains` lacks along this record is kept there
};

struct Prediction {
    std::vector<double> residuals;    // samples × channels, whitened
    double log_det = 0.0;             // Σ log det S over the samples
    bool finite = true;               // false: from some sample on the state was lost, and residuals are `lost`
    long switches = 0;                // of modes
    std::vector<std::string> states;  // names
    std::vector<double> trajectory;   // samples × states, corrected; where asked for
    std::vector<double> corrections;  // samples × states: K e
    std::vector<std::string> bodies;  // of the torques of unknown course
    std::vector<double> torques;      // samples × bodies, corrected, N·m
    std::vector<double> innovations;  // samples × channels: e, in the channels' units
    std::vector<int> pattern;         // per sample, bit c: connection c carries
    static constexpr double lost = 300.0;
};

// One replay. `gains` belong to a machine of the same states; with `learn` they are completed.
Prediction predict(const Machine& machine, const SampledRecord& record, KalmanGains& gains,
                   const PredictionOptions& options);

// A machine nearly that of a replay, or with a law more, and what is known of a record for it.
struct Neighbour {
    const Machine* machine;
    std::vector<std::map<std::string, double>> initial;  // as in PredictionOptions
    std::vector<double> offsets;                         // likewise
};

struct SensitivityOptions {
    // Share of the changes of modes that may come more than a sample before or after in a neighbour.
    double most_apart = 1.0;
    bool at_any_cost = false;  // also where replays cost less
};

// Whether first-order changes of a replay can be told: no law of the machine that is not affine, no delay, and ticks of sampled
// loops that repeat within a few samples.
bool has_sensitivities(const Machine& machine, const SampledRecord& record);

// By how much whitened innovations change, to first order, where a neighbour takes the machine's place: samples × channels;
// gains held, and those of PredictionOptions that are not the neighbours' own. Empty where that can't be told, or replays
// cost less; of neighbours with other states or switches; and of those whose switches come too often at other samples.
std::vector<std::vector<double>> sensitivities(const Machine& machine, const SampledRecord& record, KalmanGains& gains,
                                               const PredictionOptions& options,
                                               const std::vector<Neighbour>& neighbours,
                                               const SensitivityOptions& how = {});

}  // namespace dualdrive
