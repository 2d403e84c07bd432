// The mode that follows where a limiter's guard has fallen, by hand.
#include <doctest/doctest.h>

#include "../../cpp/src/simulation/mode_rules.hpp"

using namespace dualdrive;

namespace {

// On its limit, or by how much beyond; the integrator would drive it on by gain · integrand a second.
Block<double> block(double integrand, double beyond = 0.0) {
    Block<double> b{};
    b.gain = 2.0;
    b.integrand = integrand;
    b.limit = 1.0;
    b.raw = 1.0 + beyond;
    return b;
}

constexpr double outward = 1.0, inward = -1.0;

}  // namespace

TEST_CASE("a limiter rides where it falls with its integrator held and rises with it running") {
    using limiter::high, limiter::linear, limiter::riding_high, limiter::unwinding_high;
    CHECK(limiter_mode_after(block(1.0), true, linear, 0, inward) == riding_high);
    CHECK(limiter_mode_after(block(1.0), true, linear, 0, outward) == high);
    CHECK(limiter_mode_after(block(-1.0), true, linear, 0, outward) == unwinding_high);
    CHECK(limiter_mode_after(block(1.0), true, high, 0, inward) == riding_high);
    CHECK(limiter_mode_after(block(0.25), true, high, 0, inward) == linear);  // 2 · 0.25 − 1 < 0: it falls either way
    CHECK(limiter_mode_after(block(1.0), true, unwinding_high, 0, inward) == riding_high);
    CHECK(limiter_mode_after(block(1.0), true, high, 0, 0.0) == riding_high);  // with no rate at all, held
    CHECK(limiter_mode_after(block(1.0), true, unwinding_high, 0, 0.0) == linear);
}

TEST_CASE("on the other side it is the mirror image") {
    Block<double> b = block(-1.0);
    b.raw = -1.0;
    CHECK(limiter_mode_after(b, true, limiter::linear, 1, -inward) == limiter::riding_low);
    CHECK(limiter_mode_after(b, true, limiter::linear, 1, -outward) == limiter::low);
}

TEST_CASE("what jumped over its limit, or has no integrator, rides nowhere") {
    CHECK(limiter_mode_after(block(1.0, 1e-3), true, limiter::linear, 0, inward) == limiter::high);
    CHECK(limiter_mode_after(block(0.0), false, limiter::linear, 0, inward) == limiter::high);
    CHECK(limiter_mode_after(block(0.0), false, limiter::high, 0, inward) == limiter::linear);
}

TEST_CASE("a ride ends outward in saturation, inward in the open") {
    for (const Mode m : {limiter::riding_high, limiter::riding_low}) {
        CHECK(limiter_mode_after(block(1.0), true, m, 0, 0.0) == limiter::side(m));
        CHECK(limiter_mode_after(block(1.0), true, m, 1, 0.0) == limiter::linear);
    }
}

TEST_CASE("saturated it unwinds while its integrator runs inward") {
    CHECK(limiter_mode_after(block(1.0), true, limiter::high, 1, outward) == limiter::unwinding_high);
    CHECK(limiter_mode_after(block(1.0), true, limiter::unwinding_low, 1, outward) == limiter::low);
}
