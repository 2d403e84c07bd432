// What a recorder makes of a channel: the effects that sit at its name, such as sensor_delay@theta_1, outside the loop.
// In place of a channel the functions below take a sensor, table or motor_n: what its effects make of the body's angle.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dualdrive/effect.hpp"
#include "dualdrive/machine.hpp"

namespace dualdrive {

struct Recording {
    std::vector<double> values;     // per row: what is written down
    std::vector<double> by_signal;  // per row: its derivative by the signal
    std::vector<double> slopes;     // rows × parameters: its derivative by the recorder's own numbers, delay held
};

struct RecorderDelay {
    double time;                 // s, by which the channel is late; 0 is none
    std::vector<double> slopes;  // per parameter
};

// Whether an effect sits at recorded channels alone: the machine itself has nothing of it.
bool on_record(const Machine& machine, const EffectEntry& effect);

// Channels that an effect of this machine sits at, each once.
std::vector<std::string> recorded_channels(const Machine& machine);

RecorderDelay recorder_delay(const Machine& machine, const std::string& channel,
                             const std::vector<std::string>& parameters);

// The effects that change a reading on its way through these places (a sensor, then a channel), in this order.
std::vector<std::unique_ptr<Effect<double>>> reading_effects(const Machine& machine,
                                                             const std::vector<std::string>& places);

// The signal of a channel, delay and all, as it is written down at times t (s); both of one length. Parameters: paths of
// the machine; those that the recorder does not read have slope zero. Throws std::invalid_argument for an unknown path or
// unequal lengths.
Recording record(const Machine& machine, const std::string& channel, const std::vector<double>& t,
                 const std::vector<double>& signal, const std::vector<std::string>& parameters);

// The angle of a body with its two derivatives, rad, rad/s, rad/s², per row.
struct SensedMotion {
    std::vector<double> angle, speed, acceleration;
};

// By how much an effect makes a reading late, s. Throws std::invalid_argument for an unknown label.
double delay_of(const Machine& machine, const std::string& label);

// What stood at the sensor of an effect whose type is `invertible`, its delay left out, when it said this. Throws
// std::invalid_argument for an unknown label, unequal lengths, and where more than one angle has a reading.
SensedMotion taken_back(const Machine& machine, const std::string& label, const SensedMotion& said);

}  // namespace dualdrive
