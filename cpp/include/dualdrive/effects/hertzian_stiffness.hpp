// A mesh that stiffens as it is loaded: a Hertzian spring beside the linear one
//
//   T = K ξ [1 + h (u² + ε²)^¼],   u = ξ/ξ_r,   so T = K ξ (1 + h √(|ξ|/ξ_r)) for |ξ| ≫ ε ξ_r
//
//   h  growth: by what fraction the secant stiffness exceeds K at the reference overlap;  ξ_r  reference overlap, rad in
//   the pinion's frame;  ξ  overlap of the flank that carries;  ε = 0.01 rounds the root off at zero load
//
// The energy V = (2/5) K h ξ_r² [(u² + ε²)^(5/4) − ε^(5/2)] is the integral of the second term, so energy closes.
// Source: Johnson, "Contact Mechanics", Cambridge 1985, ch. 4: T ~ ξ^(3/2) of a point contact; crowned and misaligned
// teeth begin to touch that way.
// Validity: overlap small against the tooth; K is the stiffness at light load, not the one at rated load.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct HertzianStiffness {
    S growth, overlap;

    static constexpr EffectText text{
        .name = "hertzian_stiffness",
        .equation = "T = K * x * (1 + growth * sqrt(|x| / overlap)), x = overlap of the flank",
        .source = "Johnson, Contact Mechanics, Cambridge University Press 1985, ch. 4",
        .validity = "crowned or misaligned teeth under light load; K is the stiffness at light load",
        .confused_with = "time_varying_mesh_stiffness,wear",
        .places = "meshes",
        .hypothesis = {.called = "Hertzian contact stiffness"},
    };

    static constexpr auto parameters() {
        using E = HertzianStiffness;
        return fields<E, S>({
            {&E::growth, {"growth", "", non_negative, 0.0, 0.3, "excess of the stiffness at the reference overlap"}},
            {&E::overlap, {"overlap", "rad", positive, 1e-3, 1e-3, "reference overlap, pinion's frame", true}},
        });
    }

    template <class A>
    void load_contact(ContactSpring<A>& spring, const A& x, const MeshLaw<A>& law) const {
        using std::sqrt;
        const A u = x / A(overlap);
        const A square = u * u + rounding * rounding;
        const A root = sqrt(square), quarter = sqrt(root);
        const A scale = law.stiffness * A(growth * overlap);
        spring.torque += scale * u * quarter;
        spring.energy += 0.4 * scale * A(overlap) * (square * quarter - rounding * rounding * std::sqrt(rounding));
    }

  private:
    static constexpr double rounding = 1e-2;
};

}  // namespace dualdrive
