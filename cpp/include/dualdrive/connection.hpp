// A connection between two bodies: rigid, compliant, or with play (a gear mesh).
//
// The driving body turns `ratio` times as fast as the driven one. The twist is measured in the pinion's frame:
//   mesh     d = θ_driver − ratio · θ_driven            (Eq. 6 corrected: x_n = θ_cn − i_m θ_m)
//   gearbox  d = θ_driver / ratio − θ_driven            (Eq. 4 is its rigid case)
// and the torque of the connection, in the same frame, is K · dz(x; Δ) with x the deflection (twist plus what geometry
// effects add) and dz the dead zone of half width Δ (Eq. 15; Eq. 16 with the twist of the mesh put in; both corrected).
#pragma once

#include "dualdrive/parameter.hpp"

namespace dualdrive {

template <class S>
struct Connection {
    S ratio, stiffness, gap, preload;

    static constexpr auto parameters() {
        return fields<Connection, S>({
            {&Connection::ratio,
             {"ratio", "", positive, 1.0, 1.0, "speed of the driving body over speed of the driven one"}},
            {&Connection::stiffness,
             {"stiffness", "N*m/rad", positive, 1e6, 1e6, "stiffness in the pinion's frame, flank closed"}},
            {&Connection::gap, {"gap", "rad", non_negative, 0.0, 1e-3, "HALF the play, in the pinion's frame"}},
            {&Connection::preload,
             {"preload", "N*m", any, 0.0, 100.0, "torque at zero twist of a compliant connection"}},
        });
    }
};

enum class ConnectionKind { rigid, compliant, gap };
// The frame in which twist, stiffness and gap are given.
enum class TwistFrame { driver, driven };

}  // namespace dualdrive
