// Eccentricity of an encoder's disc or scale: the reading errs once per turn
//
//   reading = θ + a cos(θ + φ);   the speed made from it: ω (1 − a sin(θ + φ))
//
//   a  amplitude, rad: centre offset over the radius of the track;  φ  phase, rad;  θ, ω  angle and speed of the encoder's body
//
// Source: Celera Motion (MicroE), "How does scale eccentricity or bearing runout affect angular error?": e / r, that is
// 412.5″ × e in µm / diameter in mm.
// Validity: one reading head; two heads opposite each other cancel it. At table or motor the loop follows the error; at
// theta_n or theta_m of a record only the record shows it. With a delay at the same motor the phase is that of now.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct EncoderEccentricity {
    S amplitude, phase;

    static constexpr EffectText text{
        .name = "encoder_eccentricity",
        .equation = "reading = angle + amplitude * cos(angle + phase)",
        .source = "Celera Motion (MicroE), How does scale eccentricity affect angular error: 412.5 arcsec * um / mm",
        .validity = "one reading head; an angle, or a speed made from it",
        .confused_with = "eccentricity,unbalance",
        .places = "table,motors",
        .of_angle = true,
    };

    static constexpr auto parameters() {
        return fields<EncoderEccentricity, S>({
            {&EncoderEccentricity::amplitude,
             {"amplitude", "rad", non_negative, 0.0, 1e-5, "centre offset over the radius of the track"}},
            {&EncoderEccentricity::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero"}},
        });
    }

    S reading(const S& signal, const SensorPort<S>& at) const {
        using std::sin, std::cos;
        if (at.measures == Measures::speed) return signal - amplitude * at.speed * sin(at.angle + phase);
        if (at.measures == Measures::angle) return signal + amplitude * cos(signal + phase);
        return signal;
    }
};

}  // namespace dualdrive
