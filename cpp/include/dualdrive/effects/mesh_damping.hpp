// Damping of a gear mesh, parallel to its stiffness while a flank carries
//
//   T = max(0, K (x − Δ) + c ẋ) for x ≥ Δ,   min(0, K (x + Δ) + c ẋ) for x ≤ −Δ,   else 0
//
//   c  coefficient, N·m·s/rad in the pinion's frame;  x  mesh deflection
//
// The connection owns that law (a flank never pulls); this effect gives c.
// Source: Kahraman, Singh, "Non-linear dynamics of a spur gear pair", J. Sound and Vibration 142 (1990) 49–75; the
// damping ratio of a loaded mesh is usually 0.03 … 0.17.
// Validity: small deflections of a lubricated mesh. Touching is a jump in torque, leaving is not.
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct MeshDamping {
    S coefficient;

    static constexpr EffectText text{
        .name = "mesh_damping",
        .equation = "T = K * (x - gap) + coefficient * dx/dt while a flank carries; a flank never pulls",
        .source = "Kahraman, Singh, J. Sound and Vibration 142 (1990) 49-75",
        .validity = "small deflections of a lubricated mesh",
        .confused_with = "viscous",
        .places = "meshes",
        .affine = true,
    };

    static constexpr auto parameters() {
        return fields<MeshDamping, S>({
            {&MeshDamping::coefficient,
             {"coefficient", "N*m*s/rad", non_negative, 0.0, 1e4,
              "damping torque per rate of deflection, pinion's frame"}},
        });
    }

    template <class A>
    void shape_mesh(MeshLaw<A>& law, const MeshPort<A>&) const {
        law.damping += coefficient;
    }
};

}  // namespace dualdrive
