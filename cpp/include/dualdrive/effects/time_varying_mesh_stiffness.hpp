// Mesh stiffness that swings as one and two pairs of teeth take turns: K(θ) = K [1 + a cos(z θ + φ)]
//
//   a  amplitude, fraction of K;  z  teeth of the wheel at whose angle θ it is given;  φ  phase, rad
//
// Source: Kahraman, Singh, "Interactions between time-varying mesh stiffness and clearance non-linearities in a geared
// system", J. Sound and Vibration 146 (1991) 135–156.
// Validity: first harmonic of the tooth order. The stiffness stands in the mesh energy ½ K(θ) ξ², so both wheels feel
// ½ ξ² dK/dθ and energy closes.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct TimeVaryingMeshStiffness {
    S amplitude, teeth, phase;

    static constexpr EffectText text{
        .name = "time_varying_mesh_stiffness",
        .equation = "K = stiffness * (1 + amplitude * cos(teeth * angle + phase))",
        .source = "Kahraman, Singh, J. Sound and Vibration 146 (1991) 135-156",
        .validity = "first harmonic of the tooth order, spur gears",
        .confused_with = "transmission_error,hertzian_stiffness",
        .places = "pinions,meshes",
        // no wheel has four teeth
        .hypothesis = {.called = "varying mesh stiffness", .carrier = "torque", .lowest_order = 5.0},
    };

    static constexpr auto parameters() {
        using E = TimeVaryingMeshStiffness;
        return fields<E, S>({
            {&E::amplitude, {"amplitude", "", Bounds{0.0, 0.9}, 0.0, 0.1, "swing of the stiffness, fraction of it"}},
            {&E::teeth, {"teeth", "", positive, 20.0, 1.0, "periods per revolution: teeth of the wheel", true}},
            {&E::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero"}},
        });
    }

    template <class A>
    void shape_mesh(MeshLaw<A>& law, const MeshPort<A>& at) const {
        using std::cos;
        law.stiffness *= A(1.0) + A(amplitude) * cos(A(teeth) * at.angle + A(phase));
    }
};

}  // namespace dualdrive
