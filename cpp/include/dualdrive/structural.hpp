// Structural effects: those that are a part of the machine and not a law added to it.
//
// A limit, a lag and a shaft that gives are in the machine already, as the limiter, the delay line and the connection.
// Such an effect names that part where a user looks for it; its parameters are the part's own numbers under the part's
// own names, one value with two paths: `current_limit@motors.T_max` is motor_1.T_max and motor_2.T_max. Adding it to a
// joint makes the joint at least as loose as it needs; taking it out switches the part off. See
// docs/adr/0008-structural-effects.md.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "dualdrive/parameter.hpp"

namespace dualdrive {

// The declarations of a component's numbers, by name.
template <class Component, std::size_t N>
constexpr std::array<Declaration, N> lent_by(const char* const (&names)[N]) {
    std::array<Declaration, N> list{};
    for (std::size_t k = 0; k < N; ++k) {
        bool found = false;
        for (const auto& field : Component::parameters())
            if (std::string_view(field.declaration.name) == names[k]) {
                list[k] = field.declaration;
                found = true;
            }
        if (!found) throw "no number of that name in this component";
    }
    return list;
}

namespace detail {
template <class E>
concept Structural = requires { E::part; };
}  // namespace detail

}  // namespace dualdrive
