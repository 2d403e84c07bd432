// Transmission error at the tooth order: the mesh deflection gains a cos(z θ + φ)
//
//   a  amplitude at the pinion, rad;  z  teeth of the wheel at whose angle θ it is given;  φ  phase, rad
//
// A profile or pitch error δ along the line of action is a = δ / r_b with r_b the pinion's base radius: 2 µm at 0.2 m are
// 1e-5 rad.
// Source: Gregory, Harris, Munro, "Dynamic behaviour of spur gears", Proc. IMechE 178 (1963) 207–218.
// Validity: first harmonic of the tooth order, independent of load. It enters the mesh energy, so forces on both wheels
// follow from it and energy closes. Once-per-turn errors are `eccentricity`.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct TransmissionError {
    S amplitude, teeth, phase;

    static constexpr EffectText text{
        .name = "transmission_error",
        .equation = "deflection = twist + amplitude * cos(teeth * angle + phase)",
        .source = "Gregory, Harris, Munro, Proc. Institution of Mechanical Engineers 178 (1963) 207-218",
        .validity = "first harmonic of the tooth order, independent of load",
        .confused_with = "time_varying_mesh_stiffness,eccentricity",
        .places = "pinions,table",
        // no wheel has four teeth
        .hypothesis = {.lowest_order = 5.0},
    };

    static constexpr auto parameters() {
        using E = TransmissionError;
        return fields<E, S>({
            {&E::amplitude, {"amplitude", "rad", non_negative, 0.0, 2e-5, "twist at the pinion"}},
            {&E::teeth, {"teeth", "", positive, 20.0, 1.0, "periods per revolution: teeth of the wheel", true}},
            {&E::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero"}},
        });
    }

    template <class A>
    void shape_mesh(MeshLaw<A>& law, const MeshPort<A>& at) const {
        using std::cos;
        law.offset += A(amplitude) * cos(A(teeth) * at.angle + A(phase));
    }
};

}  // namespace dualdrive
