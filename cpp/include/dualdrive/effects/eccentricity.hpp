// Eccentricity of a pinion or of the ring: the mesh deflection gains a cos(θ + φ), once per turn of the wheel
//
//   deflection = twist + a cos(θ + (n − 1) σ + φ)
//
//   a  amplitude in the pinion's frame, rad;  θ  angle of the eccentric wheel, rad;  φ  phase, rad;
//   σ  spacing, rad: how much earlier in the ring's turn mesh 2 sees what mesh 1 sees (0 for a pinion); n  number of the mesh
//
// A centre offset e moves the flanks by e cos(·) along the line of action, hence a = e / r_b with r_b the pinion's base
// radius, for either wheel: 20 µm at 0.2 m are 1e-4 rad. A run-out gauge reads 2e.
// Source: Smith, "Gear Noise and Vibration", Marcel Dekker: run-out as once-per-turn transmission error.
// Validity: e small against the tooth depth; the gap's once-per-turn change, 2e tan α at most, is left out.
// The deflection enters the mesh energy, so both bodies get the forces that follow from it and energy closes.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct Eccentricity {
    S amplitude, phase, spacing;

    static constexpr EffectText text{
        .name = "eccentricity",
        .equation = "deflection = twist + amplitude * cos(angle + (mesh number - 1) * spacing + phase)",
        .source = "Smith, Gear Noise and Vibration, Marcel Dekker: run-out as once-per-turn transmission error",
        .validity = "centre offset small against the tooth depth; gap unchanged",
        .confused_with =
            "eccentricity,encoder_eccentricity",  // of the other wheel: turns tell; of the encoder: inertia
        .places = "table,pinions",
    };

    static constexpr auto parameters() {
        return fields<Eccentricity, S>({
            {&Eccentricity::amplitude,
             {"amplitude", "rad", non_negative, 0.0, 1e-4, "twist at the pinion: centre offset over base radius"}},
            {&Eccentricity::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero, seen at mesh 1"}},
            {&Eccentricity::spacing,
             {"spacing", "rad", any, 0.0, 1.0, "ring only: angle from each mesh to the next; 0 for a pinion", true}},
        });
    }

    template <class A>
    void shape_mesh(MeshLaw<A>& law, const MeshPort<A>& at) const {
        using std::cos;
        law.offset += amplitude * cos(at.angle + (at.number - 1) * spacing + phase);
    }
};

}  // namespace dualdrive
