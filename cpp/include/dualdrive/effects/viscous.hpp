// Viscous friction: T = −b ω
//
//   b  coefficient, N·m·s/rad in the frame of the body it sits on
//
// Source: the b_n ω_cn and b_m ω_m terms of the plant equations; any text on dynamics, e.g. Armstrong-Hélouvry, Dupont,
// Canudas de Wit, "A survey of models, analysis tools and compensation methods for the control of machines with
// friction", Automatica 30 (1994) 1083–1138.
// Validity: full fluid film, temperature constant. It adds to the `b` of the body, so the data know their sum only.
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct Viscous {
    S coefficient;

    static constexpr EffectText text{
        .name = "viscous",
        .equation = "T = -coefficient * speed",
        .source = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083-1138",
        .validity = "full fluid film at constant temperature",
        .confused_with = "viscous",  // the same friction on a body rigidly geared to this one
        .places = "table,pinions,motors",
        .affine = true,
        .hypothesis = {.called = "viscous friction", .friction = true},
    };

    static constexpr auto parameters() {
        return fields<Viscous, S>({
            {&Viscous::coefficient,
             {"coefficient", "N*m*s/rad", non_negative, 0.0, 100.0, "friction torque per speed of the body"}},
        });
    }

    S torque_on_body(const BodyPort<S>& at) const { return -(coefficient * at.speed); }
};

}  // namespace dualdrive
