// Quantisation: a reading is a whole number of steps, y = q round(x / q)
//
//   q  step, in the SI unit of the channel; 0 is none
//
// Source: Widrow, Kollár, "Quantization Noise", Cambridge 2008: error within ± q/2, of variance q²/12 while the signal
// crosses many steps.
// Validity: exact rounding, ties to even. On a record always. In the loop only where the loop samples the sensor: the
// table's angle with controller.position_sample, a motor's encoder with controller.speed_samples; a continuous loop would
// have to switch at every count, and is refused.
// Derivatives are those of the unrounded reading, true in the mean (Widrow, Kollár); there is none by q.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct Quantisation {
    S step;

    static constexpr EffectText text{
        .name = "quantisation",
        .equation = "reading = step * round(signal / step)",
        .source = "Widrow, Kollar, Quantization Noise, Cambridge 2008",
        .validity = "on a record, or where the loop samples its sensor; derivatives in the mean, none by the step",
        .confused_with = "",
        .places = "table,motors",
        .rounds = true,
        .hypothesis = {.untried = "rounding is read off a channel"},
    };

    static constexpr auto parameters() {
        return fields<Quantisation, S>({
            {&Quantisation::step,
             {"step", "", non_negative, 0.0, 1e-6, "one count, in the SI unit of its channel; 0 = none", true}},
        });
    }

    S reading(const S& signal, const SensorPort<S>&) const {
        const double q = value_of(step), x = value_of(signal);
        return q > 0 ? signal + (q * std::nearbyint(x / q) - x) : signal;
    }
};

}  // namespace dualdrive
