// A parameter is declared once, beside the member that holds it: name, unit, bounds, default, doc.
//
// The declaration travels from here to Python, machine files, the command line, HDF5, the docs and
// the fits. A component is a plain struct of numbers, all of one scalar type, with a static
// `parameters()` that lists one Field per member in member order; `Fields` refuses at compile time
// a list that disagrees with the struct.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string>

namespace dualdrive {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

struct Bounds {
    double low = -infinity;
    double high = infinity;
    bool low_excluded = false;  // zero itself is no inertia, no stiffness, no ratio
};
inline constexpr Bounds any{};
inline constexpr Bounds positive{0.0, infinity, true};
inline constexpr Bounds non_negative{0.0, infinity, false};
inline constexpr Bounds fraction{0.0, 1.0, false};

struct Declaration {
    const char* name;
    const char* unit;  // SI, as pint reads it; "rotary" form, a linear machine reads N for N*m and
                       // m for rad
    Bounds bounds;
    double standard;  // the default
    double typical;   // a usual size: prior width of an effect, scale of a step
    const char* doc;
    bool counted = false;  // counted, chosen or read off, not fitted unless it is named
};

template <class Component, class S>
struct Field {
    S Component::* member;
    Declaration declaration;
};

template <class Component, class S, std::size_t N>
constexpr std::array<Field<Component, S>, N> fields(const Field<Component, S> (&list)[N]) {
    static_assert(sizeof(Component) == N * sizeof(S), "members and parameters() of a component disagree");
    std::array<Field<Component, S>, N> r{};
    for (std::size_t k = 0; k < N; ++k) {
        for (std::size_t j = 0; j < k; ++j)
            if (list[j].member == list[k].member) throw "a member is declared twice";
        r[k] = list[k];
    }
    return r;
}

// The same for a component that extends another: its own numbers first, then the base's.
template <class Component, class S, std::size_t N, class Base, std::size_t M>
constexpr std::array<Field<Component, S>, N + M> fields(const Field<Component, S> (&own)[N],
                                                        const std::array<Field<Base, S>, M>& inherited) {
    Field<Component, S> list[N + M]{};
    for (std::size_t k = 0; k < N; ++k) list[k] = own[k];
    for (std::size_t k = 0; k < M; ++k) list[N + k] = {inherited[k].member, inherited[k].declaration};
    return fields<Component, S>(list);
}

// How many parameters a component declares.
template <class Component>
inline constexpr std::size_t parameter_count = Component::parameters().size();

// Fill a component of scalar S from consecutive entries of a parameter vector.
template <class Component, class S>
Component read_component(const S* values) {
    Component c;
    std::size_t k = 0;
    for (const auto& f : Component::parameters()) c.*(f.member) = values[k++];
    return c;
}

}  // namespace dualdrive
