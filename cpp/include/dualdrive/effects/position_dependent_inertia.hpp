// Inertia that varies with the angle: J(θ) = J [1 + a cos(nθ + φ)]
//
//   a  amplitude, fraction of the body's own J;  n  order per revolution of the body;  φ  phase, rad
//
// The equation of motion follows from the kinetic energy ½ J(θ) ω²: J(θ) ω̇ + ½ J'(θ) ω² = T, so energy closes.
// Source: Goldstein, Poole, Safko, "Classical Mechanics", Addison-Wesley 2002, ch. 1: Lagrange's equations; a slide or a
// workpiece that moves against the axis as the table turns.
// Validity: one harmonic. a < 1 keeps the inertia positive.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct PositionDependentInertia {
    S amplitude, order, phase;

    static constexpr EffectText text{
        .name = "position_dependent_inertia",
        .equation = "J = J * (1 + amplitude * cos(order * angle + phase)), J * alpha + 1/2 * dJ/dangle * speed^2 = T",
        .source = "Goldstein, Poole, Safko, Classical Mechanics, Addison-Wesley 2002, ch. 1",
        .validity = "one harmonic of the angle",
        .confused_with = "unbalance",
        .places = "table,pinions,motors",
        // of a load; a rotor's does not turn with it
        .hypothesis = {.called = "angle-dependent inertia", .places = "table", .modulates = "J"},
    };

    static constexpr auto parameters() {
        using E = PositionDependentInertia;
        return fields<E, S>({
            {&E::amplitude, {"amplitude", "", Bounds{0.0, 0.9}, 0.0, 0.1, "swing of the inertia, fraction of J"}},
            {&E::order, {"order", "", positive, 1.0, 1.0, "periods per revolution of the body", true}},
            {&E::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero; 0: largest there"}},
        });
    }

    void shape_inertia(Dual<S, 1>& inertia, const Dual<S, 1>& angle) const {
        using std::cos;
        using A = Dual<S, 1>;
        inertia *= A(1.0) + A(amplitude) * cos(A(order) * angle + A(phase));
    }
};

}  // namespace dualdrive
