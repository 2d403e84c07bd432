// Backlash of the reducer: play ahead of the pinion, with the motor's own inertia free behind it
//
//   d = θ_motor / i − θ_pinion,  T = K dz(d; Δ) at the pinion
//
//   Δ  gap, HALF the play, rad in the pinion's frame;  K  stiffness of the reducer with its flank closed, N·m/rad
//
// Source: Nordin, Gutman, "Controlling mechanical systems with backlash – a survey", Automatica 38 (2002) 1633–1649.
// Validity: one play in the reducer, flanks as in a mesh (a flank never pulls). Motor and pinion are then two bodies:
// both need inertia, and friction sits at one of them. It is gearbox_n as a connection of kind gap; a gap of zero is a
// compliant reducer. Near off: a stiffness that lets the two bodies ring at 1 kHz.
// A tensioned drive hides it: it shows once the tension releases, at reversal, or in a motor–table difference.
#pragma once

#include "dualdrive/connection.hpp"
#include "dualdrive/effect.hpp"
#include "dualdrive/structural.hpp"

namespace dualdrive {

template <class S>
struct GearboxBacklash {
    static constexpr EffectText text{
        .name = "gearbox_backlash",
        .equation = "T = stiffness * deadzone(motor angle / ratio - pinion angle; gap), of gearbox_n as kind = gap",
        .source = "Nordin, Gutman, Automatica 38 (2002) 1633-1649",
        .validity =
            "one play in the reducer; motor and pinion each need an inertia of their own; added, it rings at 1 kHz",
        .confused_with = "wear,shaft_compliance",
        .places = "gearboxes",
        .affine = true,
        .brings = "mesh_damping",
    };
    static constexpr Part part = Part::joint;
    static constexpr ConnectionKind joint = ConnectionKind::gap;
    static constexpr auto parameters() { return lent_by<Connection<S>>({"gap", "stiffness"}); }
};

}  // namespace dualdrive
