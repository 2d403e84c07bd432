// A gap that is wider where teeth are worn: Δ(θ) = Δ + d exp{[cos(n(θ − θ_0)) − 1] / (n w)²}
//
//   d  depth: added half gap at the worst place, rad in the pinion's frame;  θ_0  centre of the worn range, rad;
//   w  width: standard deviation of the range, rad;  n  worn places per revolution of the wheel
//
// A smooth, periodic bell (von Mises): near θ_0 it is exp(−(θ − θ_0)²/2w²), for wide w a cosine; it only ever adds, so no
// gap becomes negative.
// Source: Flodin, Andersson, "Simulation of mild wear in spur gears", Wear 207 (1997) 16–23: flanks lose most where they
// work most. The bell is an engineering choice for the range a table is worked over.
// Validity: wear small against the tooth depth. It enters the mesh energy, so energy closes.
#pragma once

#include <cmath>

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct Wear {
    S depth, centre, width, places_per_turn;

    static constexpr EffectText text{
        .name = "wear",
        .equation = "half gap = gap + depth * exp((cos(places * (angle - centre)) - 1) / (places * width)^2)",
        .source = "Flodin, Andersson, Wear 207 (1997) 16-23",
        .validity = "wear small against the tooth depth; of a connection with play",
        .confused_with = "wear,eccentricity,hertzian_stiffness",  // of the other wheel
        .places = "table,pinions,meshes",
        .makes_play = true,
    };

    static constexpr auto parameters() {
        using E = Wear;
        return fields<E, S>({
            {&E::depth, {"depth", "rad", non_negative, 0.0, 5e-4, "added HALF play at the centre, pinion's frame"}},
            {&E::centre, {"centre", "rad", any, 0.0, 1.0, "angle of the worst place"}},
            {&E::width, {"width", "rad", positive, 0.5, 0.3, "standard deviation of the worn range"}},
            {&E::places_per_turn, {"places", "", positive, 1.0, 1.0, "worn places per revolution of the wheel", true}},
        });
    }

    template <class A>
    void shape_mesh(MeshLaw<A>& law, const MeshPort<A>& at) const {
        using std::cos, std::exp;
        const S sharpness = 1.0 / (places_per_turn * width * places_per_turn * width);
        law.gap += A(depth) * exp(A(sharpness) * (cos(A(places_per_turn) * (at.angle - A(centre))) - A(1.0)));
    }
};

}  // namespace dualdrive
