// Patterns of modes, and the tangents that the filter's gains stand on.
#include <cmath>

#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

// Samples for which what rests may slip, to the filter. By hand; docs/theory/innovations.md says what others do.
constexpr double slips = 10.0;

}  // namespace

unsigned Flow::contacts_of(const Modes& modes) const {
    unsigned pattern = 0;
    for (std::size_t c = 0; c < contacts_.size(); ++c)
        if (flank::carries(modes[static_cast<std::size_t>(contacts_[c])])) pattern |= 1u << c;
    return pattern;
}

Modes Flow::pattern_of(const Modes& modes) const {
    Modes pattern = modes;
    for (std::size_t e = 0; e < modes.size(); ++e) {
        const SwitchKind kind = layout_.switches[e].kind;
        if (kind == SwitchKind::flank)
            pattern[e] = flank::carries(modes[e]) ? flank::front : flank::gap;
        else if (kind != SwitchKind::branch)
            pattern[e] = static_cast<Mode>(std::abs(modes[e]));
    }
    return pattern;
}

std::vector<std::string> Flow::elements() const {
    std::vector<std::string> names;
    for (const Switch& s : layout_.switches) names.push_back(s.name);
    return names;
}

Modes Flow::carrying() const {
    Modes pattern(layout_.switches.size(), limiter::linear);
    for (std::size_t e = 0; e < pattern.size(); ++e) {
        const SwitchKind kind = layout_.switches[e].kind;
        if (kind == SwitchKind::flank) pattern[e] = flank::front;
        if (kind == SwitchKind::stick) pattern[e] = stick::forward;
        if (kind == SwitchKind::branch) pattern[e] = branch::positive;
    }
    return pattern;
}

Frozen Flow::tangent_in(const Modes& modes) {
    return prepare(affine_ ? reader_.read(modes) : reader_.tangent(modes, cell_.low, y_.data()), modes);
}

Frozen Flow::tangent(const Modes& pattern, double speed) {
    std::vector<double> z(static_cast<std::size_t>(states()), 0.0);
    for (int g = 0; g < layout_.groups; ++g) z[static_cast<std::size_t>(g)] = speed;
    for (const int element : sticks_)
        if (pattern[static_cast<std::size_t>(element)] == stick::stuck) z[resting(element)] = 0.0;
    for (const int element : contacts_) {
        const auto e = static_cast<std::size_t>(element);
        if (pattern[e] != flank::front) continue;
        const auto connection = static_cast<std::size_t>(layout_.switches[e].index);
        const auto p =
            read_component<Connection<double>>(machine_.values().data() + machine_.connections()[connection].first);
        z[static_cast<std::size_t>(layout_.twist[connection])] = 1.5 * p.gap + 1e-4;
    }
    model_.evaluate(0.0, z.data(), {pattern.data(), cell_, nullptr, nullptr});
    Frozen f = prepare(affine_ ? reader_.read(pattern) : reader_.tangent(pattern, 0.0, z.data()), pattern);
    f.pattern = pattern;
    f.contacts = contacts_of(pattern);
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        const int g = layout_.group_of[static_cast<std::size_t>(bodies_[b])];
        const int element = layout_.stick_of[static_cast<std::size_t>(g)];
        if (element < 0 || pattern[static_cast<std::size_t>(element)] != stick::stuck) continue;
        const double speed_per_torque = model_.ratio(bodies_[b]) * slips * record_.step() / model_.group_inertia(g);
        f.A.col(first_disturbance() + static_cast<Eigen::Index>(b)) += f.A.col(g) * speed_per_torque;
    }
    return f;
}

}  // namespace dualdrive::innovations
