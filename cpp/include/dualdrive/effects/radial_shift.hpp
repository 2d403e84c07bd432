// Radial shift of the table: its bearing gives under the forces of the teeth, and the scale moves under the reading head
//
//   reading = θ + c F / r_s,   F = Σ_n [ T_n cos ψ_n − |T_n| tan α sin ψ_n ] / r
//
//   c  compliance of the bearing, m/N, one over its radial stiffness;  r_s  radius of the scale, m;  F  tooth forces along
//   the track at the reading head, N (tooth_forces.hpp), with ψ, σ, α, r where the meshes stand
//
// The loop follows the reading: the table turns off its target by what the scale was shifted. Where the torque in a mesh
// reverses with the direction, so does the shift: a reversal value that no gap makes.
// Source: Slocum, "Precision Machine Design", SME: error motion of an axis under load; 2 µm at 0.25 m are 1.65″.
// Validity: one reading head (two heads opposite each other cancel it), a bearing that is linear and alike in all directions.
// How the shift opens the mesh itself is part of the mesh's stiffness.
#pragma once

#include "dualdrive/effect.hpp"
#include "dualdrive/tooth_forces.hpp"

namespace dualdrive {

template <class S>
struct RadialShift : ScaleUnderTeeth<S> {
    S compliance;

    static constexpr EffectText text{
        .name = "radial_shift",
        .equation = "reading = angle + compliance / scale radius * tooth forces along the track at the reading head",
        .source = "Slocum, Precision Machine Design, SME: error motion of an axis under load",
        .validity = "one reading head, linear bearing",
        .confused_with = "table_tilt,coulomb",
        .places = "table",
        .affine = true,
        .by_force = true,
        .hypothesis = {.untried = "no record of angles shows what tooth forces do to the sensor of the table"},
    };

    static constexpr auto parameters() {
        using E = RadialShift;
        return fields<E, S>(
            {
                {&E::compliance,
                 {"compliance", "m/N", non_negative, 0.0, 1e-9, "of the bearing: one over its radial stiffness"}},
            },
            ScaleUnderTeeth<S>::parameters());
    }

    S reading(const S& signal, const SensorPort<S>& at) const {
        return signal + compliance / this->scale_radius * this->force_along_track(at.teeth);
    }
};

}  // namespace dualdrive
