// Compliance of a shaft or reducer: motor and pinion turn against each other
//
//   T = K (θ_motor / i − θ_pinion) + T_0 at the pinion
//
//   K  stiffness, N·m/rad in the pinion's frame;  T_0  preload, N·m, zero in a plain shaft
//
// Source: Leonhard, "Control of Electrical Drives", Springer: drive with elastic transmission (two-mass system).
// Validity: below the first mode that the shaft's own mass makes. Motor and pinion are then two bodies: both need
// inertia. It is gearbox_n as a connection of kind compliant, or of kind gap where that has play already. A stiffness
// cannot be infinite: added to a rigid reducer it is such that the two bodies ring against each other at 1 kHz, which
// no drive excites and a solver can still follow.
#pragma once

#include "dualdrive/connection.hpp"
#include "dualdrive/effect.hpp"
#include "dualdrive/structural.hpp"

namespace dualdrive {

template <class S>
struct ShaftCompliance {
    static constexpr EffectText text{
        .name = "shaft_compliance",
        .equation = "T = stiffness * (motor angle / ratio - pinion angle), of gearbox_n as kind = compliant",
        .source = "Leonhard, Control of Electrical Drives, Springer: drive with elastic transmission",
        .validity =
            "below the shaft's own modes; motor and pinion each need an inertia of their own; added, it rings at 1 kHz",
        .confused_with = "gearbox_backlash,sensor_delay",
        .places = "gearboxes",
        .affine = true,
        .brings = "mesh_damping",
    };
    static constexpr Part part = Part::joint;
    static constexpr ConnectionKind joint = ConnectionKind::compliant;
    static constexpr auto parameters() { return lent_by<Connection<S>>({"stiffness"}); }
};

}  // namespace dualdrive
