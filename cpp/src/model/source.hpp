// Where a user's law finds what it reads: time, the angle and speed of its place, or a signal known before body torques.
#pragma once

#include <optional>
#include <string>

#include "dualdrive/effect.hpp"
#include "dualdrive/layout.hpp"

namespace dualdrive {

struct Source {
    enum Kind { time, angle, speed, signal } kind;
    std::size_t index = 0;

    template <class S>
    const S& read(const BodyPort<S>& at) const {
        if (kind == time) return at.t;
        if (kind == angle) return at.angle;
        return kind == speed ? at.speed : at.signals[index];
    }
};

// Nothing where the machine has no such name, or knows its value too late: accelerations, energies, torques of effects.
inline std::optional<Source> find_source(const std::string& name, const Layout& layout) {
    if (name == "t") return Source{Source::time};
    if (name == "angle") return Source{Source::angle};
    if (name == "speed") return Source{Source::speed};
    int signal = layout.signal(name);
    if (signal < 0) signal = layout.signal("in." + name);
    const bool late = name.starts_with("alpha_") || name.starts_with("energy.") || name.find('@') != std::string::npos;
    if (signal < 0 || late) return std::nullopt;
    return Source{Source::signal, static_cast<std::size_t>(signal)};
}

}  // namespace dualdrive
