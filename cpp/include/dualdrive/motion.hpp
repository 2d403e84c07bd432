// Builders of input signals: steps, sines, moves, cycles of moves, recordings.
//
// A commanded motion is an angle of the table in rad (a position in m on a linear axis), its limits are the table's speed
// in rad/s, acceleration in rad/s² and jerk in rad/s³; times are in s, phases in rad, frequencies in Hz. The same
// builders serve other inputs, such as a load torque in N·m. Every builder throws std::invalid_argument, naming the
// argument, its value and the rule, when a number is not finite or breaks a rule stated here. `Waveform::end()` tells
// when the signal has come to rest.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "dualdrive/waveform.hpp"

namespace dualdrive::motion {

Waveform constant(double value);

// Zero before `at`, `height` from there on.
Waveform step(double height, double at = 0.0);

// Zero before `start`, then rising by `rate` per second until `end`, where the value is held.
Waveform ramp(double rate, double start = 0.0, double end = std::numeric_limits<double>::infinity());

// offset + amplitude · sin(2π f (t − start) + phase) from `start` on, before it the offset alone.
Waveform sine(double amplitude, double frequency_hz, double phase = 0.0, double offset = 0.0, double start = 0.0);

// Σ amplitude[k] · sin(2π f[k] (t − start) + phase[k]) from `start` on, zero before; the lists are of one length ≥ 1.
Waveform multisine(const std::vector<double>& amplitudes, const std::vector<double>& frequencies_hz,
                   const std::vector<double>& phases, double start = 0.0);

enum class Phases {
    random,    // uniform in [0, 2π), from the seed; the same on every computer
    schroeder  // −π k (k − 1)/N for line k of N: a low peak for the same RMS (Schroeder 1970)
};

// A flat multisine on `lines` odd harmonics f, 3f, 5f, ... of the base frequency, with the given RMS value. What the
// machine answers at even harmonics then is its even nonlinearity, untouched by the excitation. It begins with its own
// value at `start`, not from zero: `from_zero` subtracts that value, so that a commanded position does not jump.
Waveform odd_multisine(double rms, double base_frequency_hz, int lines, std::uint64_t seed = 0,
                       Phases phases = Phases::random, double start = 0.0, bool from_zero = false);

// The fastest move from rest at `from` to rest at `from + distance` within positive limits; distance may be negative or
// zero, jerk infinite (a trapezoid of speed), nothing else may. Seven phases of constant jerk, fewer when the move is
// too short to reach the acceleration or the speed
// (L. Biagiotti, C. Melchiorri: Trajectory Planning for Automatic Machines and Robots, 2008, section 3.4).
Waveform jerk_limited_move(double distance, double speed, double acceleration, double jerk, double start = 0.0,
                           double from = 0.0);

// A tour of positions: from rest at `from`, beginning at `start`, one such move to each target in turn, a dwell ≥ 0
// after each, the whole list `repeats` ≥ 1 times. The signal ends with the last dwell.
Waveform cycle_of_moves(const std::vector<double>& targets, double speed, double acceleration, double jerk,
                        double dwell = 0.0, double start = 0.0, int repeats = 1, double from = 0.0);

// When that cycle stands at its targets, one entry per move: where a positioning test reads its deviations.
struct Dwell {
    double target, begin, end;
};
std::vector<Dwell> dwells_of_cycle(const std::vector<double>& targets, double speed, double acceleration, double jerk,
                                   double dwell = 0.0, double start = 0.0, int repeats = 1, double from = 0.0);

// The targets of one bidirectional cycle after ISO 230-2: below the first position by `overrun` > 0, up through all
// positions, beyond the last by `overrun`, and down through all again. Positions increase, at least two.
std::vector<double> bidirectional_targets(const std::vector<double>& positions, double overrun);

enum class Interpolation {
    hold,    // the last sample's value: what a sampled set-point generator puts out; every change is a break
    linear,  // continuous, a break at every sample where the slope changes
    cubic    // not-a-knot spline, C2: no breaks but its two ends; overshoots at steps
};

// A recorded signal through `values` at increasing `times` (even or not; one sample for hold, two for the others);
// before the first and after the last sample the end values are held.
Waveform sampled(const std::vector<double>& times, const std::vector<double>& values, Interpolation interpolation);

Waveform sum(const std::vector<Waveform>& parts);
Waveform scale(const Waveform& waveform, double factor);
// The same, later by `delay` s.
Waveform shift(const Waveform& waveform, double delay);

}  // namespace dualdrive::motion
