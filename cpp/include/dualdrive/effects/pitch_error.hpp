// Pitch error of a wheel: one harmonic of its cumulative pitch deviation, k periods per turn
//
//   deflection = twist + a cos(k (θ + (n − 1) σ) + φ)
//
//   a  amplitude in the pinion's frame, rad;  k  order, periods per turn of the wheel;  θ  angle of the wheel, rad;
//   φ  phase, rad;  σ  spacing, rad: how much earlier in the ring's turn mesh 2 sees what mesh 1 sees (0 for a pinion);
//   n  number of the mesh
//
// ISO 1328-1:2013, 5.3, gives the tolerances of grade A for reference diameter d and module m, both in mm:
//   total cumulative pitch F_p = (0.002 d + 0.55 √d + 0.7 m + 12) √2^(A − 5) µm,  single pitch f_p = (0.001 d + 0.4 m + 5)
//   √2^(A − 5) µm. A deviation δ along the pitch circle is a = δ / r with r the pinion's pitch radius, for either wheel.
// Source: ISO 1328-1:2013, Cylindrical gears, flank tolerance classification; Smith, "Gear Noise and Vibration".
// Validity: a smooth part of the cumulative deviation, of orders well below the number of teeth. Order 1 is `eccentricity`,
// that of the teeth `transmission_error`. It enters the mesh energy, so forces on both wheels follow and energy closes.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct PitchError {
    S amplitude, order, phase, spacing;

    static constexpr EffectText text{
        .name = "pitch_error",
        .equation = "deflection = twist + amplitude * cos(order * (angle + (mesh number - 1) * spacing) + phase)",
        .source = "ISO 1328-1:2013, Cylindrical gears: cumulative pitch deviation; Smith, Gear Noise and Vibration",
        .validity = "orders well below the number of teeth; one harmonic each",
        .confused_with = "eccentricity,transmission_error",
        .places = "table,pinions",
        // a pitch error of order one is eccentricity
        .hypothesis = {.lowest_order = 2.0},
    };

    static constexpr auto parameters() {
        using E = PitchError;
        return fields<E, S>({
            {&E::amplitude,
             {"amplitude", "rad", non_negative, 0.0, 1e-4, "twist at the pinion: deviation over its radius"}},
            {&E::order, {"order", "", positive, 2.0, 1.0, "periods per turn of the wheel", true}},
            {&E::phase, {"phase", "rad", any, 0.0, 1.0, "phase at angle zero, seen at mesh 1"}},
            {&E::spacing,
             {"spacing", "rad", any, 0.0, 1.0, "ring only: angle from each mesh to the next; 0 for a pinion", true}},
        });
    }

    template <class A>
    void shape_mesh(MeshLaw<A>& law, const MeshPort<A>& at) const {
        using std::cos;
        law.offset += A(amplitude) * cos(A(order) * (at.angle + A((at.number - 1) * spacing)) + A(phase));
    }
};

}  // namespace dualdrive
