// Tilt of the table: tooth forces beside the bearing's plane tilt it, and the scale moves under the reading head
//
//   reading = θ + c h h_s F / r_s,   F = Σ_n [ T_n cos ψ_n − |T_n| tan α sin ψ_n ] / r
//
//   c  compliance of the bearing in tilt, rad/(N·m), one over its tilting stiffness;  h  height of the ring over the plane
//   about which the table tilts, m;  h_s  height of the scale over the same plane, m;  the others as in radial_shift
//
// The moment F h tilts the table by c F h; the scale, h_s away, moves by h_s times that along its track.
// Source: Slocum, "Precision Machine Design", SME: Abbe's principle for angular motion of a bearing.
// Validity: one reading head, small angles, a bearing that is linear and alike in all directions. The weight of a workpiece
// that stands off centre tilts by a constant, which no reversal shows.
#pragma once

#include "dualdrive/effect.hpp"
#include "dualdrive/tooth_forces.hpp"

namespace dualdrive {

template <class S>
struct TableTilt : ScaleUnderTeeth<S> {
    S compliance, ring_height, scale_height;

    static constexpr EffectText text{
        .name = "table_tilt",
        .equation =
            "reading = angle + compliance * ring height * scale height / scale radius * tooth forces along the "
            "track at the reading head",
        .source = "Slocum, Precision Machine Design, SME: Abbe's principle",
        .validity = "one reading head, small angles, linear bearing",
        .confused_with = "radial_shift,coulomb",
        .places = "table",
        .affine = true,
        .by_force = true,
        .hypothesis = {.untried = "no record of angles shows what tooth forces do to the sensor of the table"},
    };

    static constexpr auto parameters() {
        using E = TableTilt;
        return fields<E, S>(
            {
                {&E::compliance,
                 {"compliance", "rad/(N*m)", non_negative, 0.0, 1e-11,
                  "of the bearing: one over its tilting stiffness"}},
                {&E::ring_height, {"ring_height", "m", any, 0.5, 0.1, "of the ring over the plane of tilting", true}},
                {&E::scale_height,
                 {"scale_height", "m", any, 0.5, 0.1, "of the scale over the plane of tilting", true}},
            },
            ScaleUnderTeeth<S>::parameters());
    }

    S reading(const S& signal, const SensorPort<S>& at) const {
        return signal +
               compliance * ring_height * scale_height / this->scale_radius * this->force_along_track(at.teeth);
    }
};

}  // namespace dualdrive
