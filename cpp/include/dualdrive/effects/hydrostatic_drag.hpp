// Drag of a hydrostatic table: T = −(c_1 ω + c_2 ω |ω|)
//
//   c_1  viscous, N·m·s/rad: shear of the films;  c_2  quadratic, N·m·s²/rad²: turbulence in pockets and oil carried over
//
// Source: Rowe, "Hydrostatic and Hybrid Bearing Design", Butterworths 1983: friction of lands and of recesses.
// Validity: oil at constant temperature and supply pressure. The viscous share adds to the body's own `b`.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct HydrostaticDrag {
    S quadratic, viscous;

    static constexpr EffectText text{
        .name = "hydrostatic_drag",
        .equation = "T = -(viscous * speed + quadratic * speed * |speed|)",
        .source = "Rowe, Hydrostatic and Hybrid Bearing Design, Butterworths 1983",
        .validity = "oil at constant temperature and supply pressure",
        .confused_with = "viscous",
        .places = "table",
        .hypothesis = {.friction = true},
    };

    static constexpr auto parameters() {
        using E = HydrostaticDrag;
        return fields<E, S>({
            {&E::quadratic,
             {"quadratic", "N*m*s^2/rad^2", non_negative, 0.0, 1e6, "turbulence and oil that is carried over"}},
            {&E::viscous, {"viscous", "N*m*s/rad", non_negative, 0.0, 1e4, "shear of the oil films"}},
        });
    }

    S torque_on_body(const BodyPort<S>& at) const {
        using std::abs;
        return -((viscous + quadratic * abs(at.speed)) * at.speed);
    }
};

}  // namespace dualdrive
