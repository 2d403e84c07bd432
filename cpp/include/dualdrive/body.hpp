// A body: one degree of freedom with inertia and viscous friction, in its own frame (motor, pinion, table).
#pragma once

#include "dualdrive/parameter.hpp"

namespace dualdrive {

// J ω̇ + b ω = Σ torques acting on the body     (Eq. 3, 5, 7 of the source paper)
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
