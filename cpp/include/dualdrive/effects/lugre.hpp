// Friction with memory: bristles that bend before they slip, so that presliding, hysteresis and the Stribeck curve
// come from one continuous law.
//
//   T = −(σ0 z + σ1 ż),  ż = ω − σ0 |ω| z / g(ω),  g(ω) = F_c + (F_s − F_c) exp(−(ω/ω_s)²)
//
// Source: Canudas de Wit, Olsson, Åström, Lischinsky, "A new model for control of systems with friction", IEEE
// Transactions on Automatic Control 40(3), 1995. Add `viscous` for the term that grows with speed.
// Validity: presliding of a lubricated contact at constant normal load; σ1 small enough that the law stays passive
// (σ1 ≤ 4 σ0 g / |ω| over the speeds that occur).
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct LuGre {
    S torque, static_ratio, speed, stiffness, damping;

    static constexpr int memory = 1;  // the bristle deflection z, rad
    static constexpr EffectText text{
        .name = "lugre",
        .equation = "T = -(s0 z + s1 dz/dt), dz/dt = w - s0 |w| z / g(w), g = Fc + (Fs - Fc) exp(-(w/ws)^2)",
        .source = "Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995",
        .validity =
            "presliding at constant normal load; it is the whole dry friction of the body, in place of coulomb or "
            "stribeck",
        .confused_with = "stribeck,coulomb",
        .places = "table,pinions,motors",
        .hypothesis = {.called = "LuGre friction", .contains = "stribeck,coulomb", .friction = true},
    };

    static constexpr auto parameters() {
        using E = LuGre;
        return fields<E, S>({
            {&E::torque, {"torque", "N*m", non_negative, 0.0, 1000.0, "Coulomb level F_c"}},
            {&E::static_ratio, {"static_ratio", "", {1.0, 10.0, false}, 1.3, 1.3, "F_s / F_c, breakaway over Coulomb"}},
            {&E::speed, {"speed", "rad/s", positive, 1e-3, 1e-3, "Stribeck speed"}},
            {&E::stiffness, {"stiffness", "N*m/rad", positive, 1e7, 1e7, "bristle stiffness s0"}},
            {&E::damping, {"damping", "N*m*s/rad", non_negative, 0.0, 1e4, "bristle damping s1"}},
        });
    }

    S bristle_rate(const BodyPort<S>& at) const {
        using std::abs, std::exp;
        if (value_of(torque) == 0.0) return S(0.0);  // no friction, no bristle
        const S ratio = at.speed / speed;
        const S level = torque * (1.0 + (static_ratio - 1.0) * exp(-ratio * ratio));
        return at.speed - stiffness * abs(at.speed) * at.memory[0] / level;
    }
    void flow(const BodyPort<S>& at, S* rate) const { rate[0] = bristle_rate(at); }
    S torque_on_body(const BodyPort<S>& at) const {
        if (value_of(torque) == 0.0) return S(0.0);
        return -(stiffness * at.memory[0] + damping * bristle_rate(at));
    }
};

}  // namespace dualdrive
