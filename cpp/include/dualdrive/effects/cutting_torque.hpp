// Torque of a cut: a mean and the tooth-passing harmonic, from the start of the cut for its duration
//
//   T = −[m + a sin(2π f (t − t_0))] · S((t − t_0)/ρ) · S((t_0 + τ − t)/ρ)
//
//   m  mean, a  amplitude, N·m, positive against positive motion;  f  tooth-passing frequency, Hz: spindle speed times
//   teeth;  t_0  start, τ  duration, s;  ρ  rise, s: entry and exit of the tool, S(x) = x³(10 − 15x + 6x²) from 0 to 1
//
// Source: Altintas, "Manufacturing Automation", Cambridge University Press 2012, ch. 2: milling forces are periodic at the
// tooth-passing frequency.
// Validity: one harmonic of a steady cut whose force does not depend on the motion: no chatter. S is smooth to the second
// derivative, so the torque may be differentiated by start and duration.
#pragma once

#include <cmath>
#include <numbers>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct CuttingTorque {
    S mean, amplitude, frequency, start, duration, rise;

    static constexpr EffectText text{
        .name = "cutting_torque",
        .equation =
            "T = -(mean + amplitude * sin(2 pi frequency (t - start))) from start for duration, eased over rise",
        .source = "Altintas, Manufacturing Automation, Cambridge University Press 2012, ch. 2",
        .validity = "steady cut, one tooth-passing harmonic, force independent of the motion",
        .confused_with = "unbalance,coulomb",
        .places = "table",
        .hypothesis = {.untried = "a load in time is tried where the records show its hour"},
    };

    static constexpr auto parameters() {
        using E = CuttingTorque;
        return fields<E, S>({
            {&E::mean, {"mean", "N*m", any, 0.0, 1e3, "mean, against positive motion"}},
            {&E::amplitude, {"amplitude", "N*m", non_negative, 0.0, 300.0, "of the tooth-passing harmonic"}},
            {&E::frequency, {"frequency", "Hz", positive, 10.0, 10.0, "spindle speed times teeth", true}},
            {&E::start, {"start", "s", any, 0.0, 1.0, "when the tool enters"}},
            {&E::duration, {"duration", "s", positive, 1.0, 1.0, "until the tool has left"}},
            {&E::rise, {"rise", "s", positive, 0.02, 0.01, "time of entry, and of exit", true}},
        });
    }

    S torque_on_body(const BodyPort<S>& at) const {
        using std::sin;
        const S since = at.t - start;
        const S cut = mean + amplitude * sin(2.0 * std::numbers::pi * frequency * since);
        return -(cut * eased(since / rise) * eased((duration - since) / rise));
    }

    void instants(std::vector<double>& times) const {
        const double begin = value_of(start), end = begin + value_of(duration), edge = value_of(rise);
        times.insert(times.end(), {begin, begin + edge, end - edge, end});
    }

    // S(x).
    static S eased(const S& x) {
        if (!(value_of(x) > 0.0)) return S(0.0);
        if (value_of(x) >= 1.0) return S(1.0);
        return x * x * x * (10.0 + x * (6.0 * x - 15.0));
    }
};

}  // namespace dualdrive
