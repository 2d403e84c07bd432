// A sensor, or the path from it, that speaks late: y(t) = x(t − τ)
//
//   τ  time, s
//
// Source: Franklin, Powell, Workman, "Digital Control of Dynamic Systems": transport and computing delay.
// Validity: pure delay, no low-pass. On a true channel the loop feels it; on a recorded channel only the record is skewed.
// Time skew between recorded channels poses as compliance or as a wider gap.
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct SensorDelay {
    S time;

    static constexpr EffectText text{
        .name = "sensor_delay",
        .equation = "reading(t) = signal(t - time)",
        .source = "Franklin, Powell, Workman, Digital Control of Dynamic Systems",
        .validity = "pure delay, no low-pass",
        .confused_with = "stribeck",
        .places = "table,motors",
        .affine = true,
    };

    static constexpr auto parameters() {
        return fields<SensorDelay, S>({
            {&SensorDelay::time, {"time", "s", non_negative, 0.0, 1e-3, "how late the reading is"}},
        });
    }

    S delay() const { return time; }
};

}  // namespace dualdrive
