// The tooth forces on a ring gear, and what they move under a reading head.
//
// Mesh n stands at the angle ψ_n = ψ + (n − 1) σ round the table, counted from the reading head. Its teeth push the ring
// with T/r along the pitch circle and with |T| tan α / r towards the axis, T the torque on the table and r its pitch radius.
// What moves the scale along the track under the head is the component of their sum in the track's direction there:
//
//   F = Σ_n [ T_n cos ψ_n − |T_n| tan α sin ψ_n ] / r
//
// Source: Niemann, Winter, "Maschinenelemente II", Springer: tangential and radial force of a spur gear.
#pragma once

#include <cmath>
#include <span>

#include "dualdrive/effect.hpp"

namespace dualdrive {

// What the effects of these forces have in common: where the meshes stand, how their teeth push, where the scale lies.
template <class S>
struct ScaleUnderTeeth {
    S scale_radius, ring_radius, mesh_angle, spacing, pressure_angle;

    static constexpr auto parameters() {
        using T = ScaleUnderTeeth;
        return fields<T, S>({
            {&T::scale_radius, {"scale_radius", "m", positive, 0.25, 0.1, "radius of the scale's track", true}},
            {&T::ring_radius, {"ring_radius", "m", positive, 4.0, 1.0, "pitch radius of the ring", true}},
            {&T::mesh_angle, {"mesh_angle", "rad", any, 0.0, 1.0, "from the reading head to mesh 1", true}},
            {&T::spacing, {"spacing", "rad", any, 3.141592653589793, 1.0, "from each mesh to the next", true}},
            {&T::pressure_angle, {"pressure_angle", "rad", any, 0.3490658503988659, 0.1, "of the teeth", true}},
        });
    }

    S force_along_track(std::span<const ToothLoad<S>> teeth) const {
        using std::sin, std::cos, std::tan;
        S force(0.0);
        for (std::size_t n = 0; n < teeth.size(); ++n) {
            const S angle = mesh_angle + double(n) * spacing;
            force += teeth[n].torque * cos(angle) - teeth[n].size * tan(pressure_angle) * sin(angle);
        }
        return force / ring_radius;
    }
};

}  // namespace dualdrive
