// Transport delay of the command: drives get the position loop's speed set-point late
//
//   master  Ω_1(t) = Ω(t − δc),   slave  Ω_2(t) = Ω_1(t − δt)
//
//   Ω  what the position loop puts out;  δc  command lag, s: interpolator, bus, computing;  δt  slave lag, s
//
// Source: Franklin, Powell, Workman, "Digital Control of Dynamic Systems": transport and computing delay; δt is the lag
// between the drives in the source paper.
// Validity: pure delay of a continuous or sampled loop. The two are controller.delta_c and controller.delta_t. A sampled
// loop's computing time within its sample is controller.*_latency, and no second one is made of it here.
#pragma once

#include "dualdrive/controller.hpp"
#include "dualdrive/effect.hpp"
#include "dualdrive/structural.hpp"

namespace dualdrive {

template <class S>
struct TransportDelay {
    static constexpr EffectText text{
        .name = "transport_delay",
        .equation =
            "set-point of every drive delta_c late, of slaves another delta_t; one number each with controller.*",
        .source = "Franklin, Powell, Workman, Digital Control of Dynamic Systems",
        .validity = "pure delay of the speed set-point",
        .confused_with = "sensor_delay,stribeck",
        .places = "controller",
        .affine = true,
        .hypothesis = {.causes = true},
    };
    static constexpr Part part = Part::controller;
    static constexpr auto parameters() { return lent_by<Controller<S>>({"delta_c", "delta_t"}); }
};

}  // namespace dualdrive
