#include "affine.hpp"

#include <algorithm>

#include "dualdrive/effects.hpp"
#include "dualdrive/expression.hpp"
#include "dualdrive/recorder.hpp"

namespace dualdrive {

namespace {

// Whether a flank owns the sign of every tooth force on the ring; elsewhere the force's size bends at zero.
bool flanks_on_the_ring(const Machine& machine) {
    return std::all_of(machine.connections().begin(), machine.connections().end(), [&](const ConnectionEntry& c) {
        const bool on_ring = c.frame == TwistFrame::driver && c.driven == machine.body("table");
        return !on_ring || c.kind == ConnectionKind::rigid ||
               (c.kind == ConnectionKind::gap &&
                read_component<Connection<double>>(machine.values().data() + c.first).gap > 0.0);
    });
}

bool is_affine(const Machine& machine, const EffectEntry& effect) {
    if (effect.formula.empty()) {
        const EffectText& text = effect_type(effect.name).text;  // a spline is not
        return text.affine && (!text.by_force || flanks_on_the_ring(machine));
    }
    using Growth = Expression::Growth;
    const auto slots = machine.slots().begin() + static_cast<std::ptrdiff_t>(effect.first);
    return Expression::parse(effect.formula).is_affine([&](std::string_view name) {
        const auto is_own = [&](const auto& slot) { return slot.path == effect.label + "." + std::string(name); };
        if (name == "t") return Growth::other;
        if (name == "angle" || name == "speed") return Growth::affine;
        const bool own = std::any_of(slots, slots + static_cast<std::ptrdiff_t>(effect.count), is_own);
        return own ? Growth::none : Growth::affine;
    });
}

}  // namespace

std::optional<std::string> effect_that_is_not_affine(const Machine& machine) {
    for (const EffectEntry& effect : machine.effects())
        if (!on_record(machine, effect) && !is_affine(machine, effect)) return effect.label;
    return std::nullopt;
}

}  // namespace dualdrive
