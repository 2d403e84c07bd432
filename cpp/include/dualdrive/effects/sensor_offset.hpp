// A sensor that reads too much by a constant: y = x + o
//
//   o  value, in the SI unit of its channel
//
// Source: JCGM 200:2012 (VIM), systematic measurement error, constant under replicate measurements.
// Validity: over a record short enough for drift not to matter. An offset of a torque channel is, in one direction of
// motion, the same as friction.
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct SensorOffset {
    S value;

    static constexpr EffectText text{
        .name = "sensor_offset",
        .equation = "reading = signal + value",
        .source = "JCGM 200:2012 (VIM), systematic measurement error",
        .validity = "no drift within the record",
        .confused_with = "coulomb",
        .places = "table,motors",
        .affine = true,
        .hypothesis = {.untried = "a constant of a sensor is a nuisance that every fit bears already"},
    };

    static constexpr auto parameters() {
        return fields<SensorOffset, S>({
            {&SensorOffset::value,
             {"value", "", any, 0.0, 1e-5, "what the sensor adds, in the SI unit of its channel"}},
        });
    }

    S reading(const S& signal, const SensorPort<S>&) const { return signal + value; }
};

}  // namespace dualdrive
