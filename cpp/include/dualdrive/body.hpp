// A body: one degree of freedom with inertia and viscous friction, in its own frame (motor, pinion, table).
#pragma once

#include "dualdrive/parameter.hpp"

namespace dualdrive {

// J ω̇ + b ω = Σ torques acting on the body: the motor (Eq. 3), the driving gear (Eq. 5) and the table (Eq. 7), whose
// torque is what all meshes give it (Eq. 8).
template <class S>
struct Body {
    S J, b;

    static constexpr auto parameters() {
        return fields<Body, S>({
            {&Body::J, {"J", "kg*m^2", non_negative, 1.0, 1.0, "moment of inertia in the body's own frame"}},
            {&Body::b, {"b", "N*m*s/rad", non_negative, 0.0, 1.0, "viscous friction coefficient"}},
        });
    }
};

}  // namespace dualdrive
