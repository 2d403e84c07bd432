// Effects put into a machine and taken out: where each may sit, and the numbers that come and go with it.
#include <algorithm>
#include <cmath>

#include "dualdrive/effects.hpp"
#include "dualdrive/expression.hpp"
#include "dualdrive/machine.hpp"
#include "refuse.hpp"

namespace dualdrive {

namespace {

// The name of a recorded channel (interface: canonical names of measured traces).
bool is_channel(std::string_view name) {
    for (const std::string_view stem : {"theta_", "omega_", "I_", "U_", "T_"})
        if (name.starts_with(stem) && name.size() > stem.size()) return true;
    return false;
}

bool acts_on_body(const EffectType& type) { return type.hooks & (hook::body | hook::friction | hook::inertia); }

}  // namespace

const std::string& Machine::append_effect(EffectEntry entry) {
    entry.label = entry.name + "@" + entry.place;
    const auto taken = [&](const std::string& label) {
        return std::any_of(effects_.begin(), effects_.end(), [&](const EffectEntry& e) { return e.label == label; });
    };
    const std::string base = entry.label;
    for (int n = 2; taken(entry.label); ++n) entry.label = base + "#" + std::to_string(n);
    effects_.push_back(std::move(entry));
    return effects_.back().label;
}

// Somewhere a mesh effect can bite: a connection with twist, the pinion that drives one, or the ring.
bool Machine::shapes_a_mesh(const std::string& place, bool with_play) const {
    return std::any_of(connections_.begin(), connections_.end(), [&](const ConnectionEntry& c) {
        if (c.kind == ConnectionKind::rigid || (with_play && c.kind != ConnectionKind::gap)) return false;
        const auto& driver = bodies_[static_cast<std::size_t>(c.driver)].name;
        const bool ring =
            (place == "ring" || place == "table") && bodies_[static_cast<std::size_t>(c.driven)].name == "table";
        return c.name == place || (c.frame == TwistFrame::driver && (driver == place || ring));
    });
}

// Whether an effect of this type may sit at one place, named or a member of a group.
void Machine::check_place(const EffectType& type, const std::string& member) const {
    const std::string effect = std::string("effect ") + type.text.name + ": ";
    if (acts_on_body(type) && body(member) < 0)
        refuse(effect + "no body named " + member + " to act on; bodies are motor_n, pinion_n, table");
    if (type.hooks & (hook::motor | hook::voltage | hook::estimate) && motor(member) < 0)
        refuse(effect + "no motor named " + member);
    if (type.hooks & hook::voltage && motors_[static_cast<std::size_t>(motor(member))].kind == MotorKind::direct)
        refuse(effect + member + " is a direct torque source without a circuit; choose kind = armature first");
    if (type.hooks & hook::mesh && !shapes_a_mesh(member))
        refuse(effect + member +
               " is no place for it; it acts at a mesh or gearbox that is not rigid, at a pinion, or at the ring");
    if (type.text.makes_play && !shapes_a_mesh(member, true))
        refuse(effect + member + " has no connection with play; set kind = gap there first");
    if (type.hooks & (hook::reading | hook::delay) && member != "table" && motor(member) < 0 && !is_channel(member))
        refuse(effect + member +
               " is no sensor; it sits at table or motor_n (inside the loop), or at a recorded channel such as "
               "theta_m");
    if (type.text.by_force && member != "table")
        refuse(effect + member + " is no place for it; it changes what the table's sensor reads, so it sits at table");
    if (type.text.by_force && !shapes_a_mesh(member))
        refuse(effect +
               "every mesh on the table is rigid, and the forces of its teeth are not known; give one play or "
               "compliance");
    if (type.text.of_angle && is_channel(member) && !member.starts_with("theta_"))
        refuse(effect + member + " is no angle; it sits at a channel such as theta_m or theta_1");
    if (type.structural()) check_part(type, member);
}

const std::string& Machine::add_effect(const std::string& effect_name, const std::string& place) {
    const EffectType& type = effect_type(effect_name);
    if (is_user_law(type))
        refuse("effect " + effect_name + ": it is written by its user; give " +
               (effect_name == "spline" ? "coordinate, low, high and values" : "a formula and its parameters"));
    EffectEntry entry{effect_name, place, "", members_of(place), "", 0, type.parameters.size()};
    if (entry.members.empty()) entry.members = {place};
    for (auto& m : entry.members) {
        if (acts_on_body(type) && m == "ring") m = "table";
        check_place(type, m);
    }
    if (type.structural()) entry.count = 0;  // its numbers are the part's
    const std::string& label = append_effect(std::move(entry));
    effects_.back().first = declare(label, type.parameters.data(), effects_.back().count);
    if (type.part == Part::joint) settle_joints();
    return label;
}

EffectEntry Machine::user_law(const char* effect_name, const std::string& place, std::size_t count,
                              const std::vector<Column>& columns) const {
    EffectEntry entry{effect_name, place, "", members_of(place), "", 0, count};
    entry.columns = columns;
    if (entry.members.empty()) entry.members = {place};
    for (const auto& m : entry.members)
        if (body(m) < 0) refuse(std::string("effect ") + effect_name + ": no body named " + m + " to act on");
    return entry;
}

const std::string& Machine::add_expression(const std::string& place, const std::string& formula,
                                           const std::vector<FormulaParameter>& parameters,
                                           const std::vector<Column>& columns) {
    for (const auto& p : parameters)
        if (!std::isfinite(p.value)) refuse("effect expression@" + place + ": parameter " + p.name + " is not finite");
    EffectEntry entry = user_law("expression", place, parameters.size(), columns);
    entry.formula = formula;
    const std::string& label = append_effect(std::move(entry));
    effects_.back().first = slots_.size();
    for (const auto& p : parameters) {
        slots_.push_back({label + "." + p.name, p.unit, "parameter of the formula", any, p.value,
                          p.value == 0.0 ? 1.0 : std::abs(p.value), false});
        values_.push_back(p.value);
    }
    return label;
}

const std::string& Machine::add_spline(const std::string& place, const std::vector<CurveAxis>& axes,
                                       const std::vector<double>& values, double usual_size,
                                       const std::vector<Column>& columns) {
    if (axes.empty() || axes.size() > 2)
        refuse("effect spline: it takes one coordinate or two, not " + std::to_string(axes.size()));
    std::size_t count = 1;
    for (const auto& axis : axes) {
        const int fewest = axis.periodic ? 3 : 2;
        if (!(std::isfinite(axis.low) && std::isfinite(axis.high) && axis.low < axis.high))
            refuse("effect spline: " + axis.coordinate + ": low = " + rounded(axis.low) +
                   " must lie below high = " + rounded(axis.high) + ", both finite");
        if (axis.knots < fewest || axis.knots > 1000)
            refuse("effect spline: " + axis.coordinate + ": " + std::to_string(axis.knots) + " knots; give between " +
                   std::to_string(fewest) + " and 1000");
        count *= static_cast<std::size_t>(axis.knots);
    }
    if (values.size() != count)
        refuse("effect spline: " + std::to_string(values.size()) + " values for " + std::to_string(count) + " knots");
    if (!(usual_size > 0) || std::isinf(usual_size))
        refuse("effect spline: size = " + rounded(usual_size) + " N*m must be positive and finite");
    for (const double v : values)
        if (!std::isfinite(v)) refuse("effect spline: a value is not finite");
    EffectEntry entry = user_law("spline", place, count, columns);
    entry.axes = axes;
    const std::string& label = append_effect(std::move(entry));
    effects_.back().first = slots_.size();
    const auto width = static_cast<std::size_t>(axes.back().knots);
    for (std::size_t k = 0; k < count; ++k) {
        const std::string row = axes.size() == 2 ? "_" + std::to_string(k / width) : "";
        slots_.push_back({label + ".value" + row + "_" + std::to_string(k % width), "N*m", "torque at a knot", any,
                          values[k], usual_size, false});
        values_.push_back(values[k]);
    }
    return label;
}

std::vector<std::string> names_read(const EffectEntry& effect) {
    if (!effect.formula.empty()) return Expression::parse(effect.formula).names();
    std::vector<std::string> names;
    for (const auto& axis : effect.axes) names.push_back(axis.coordinate);
    return names;
}

const EffectEntry& Machine::effect(const std::string& label) const {
    std::vector<std::string> known;
    for (const auto& e : effects_) {
        if (e.label == label) return e;
        known.push_back(e.label);
    }
    refuse("effect " + label + ": not in this machine" + near_names(label, known));
}

void Machine::remove_effect(const std::string& label) {
    const auto it = effects_.begin() + (&effect(label) - effects_.data());
    const EffectEntry removed = *it;
    const std::size_t first = it->first, count = it->count;
    const auto from = static_cast<std::ptrdiff_t>(first), to = static_cast<std::ptrdiff_t>(first + count);
    slots_.erase(slots_.begin() + from, slots_.begin() + to);
    values_.erase(values_.begin() + from, values_.begin() + to);
    effects_.erase(it);
    const auto shift = [&](std::size_t& f) {
        if (f > first) f -= count;
    };
    for (auto& e : effects_) shift(e.first);
    for (auto& b : bodies_) shift(b.first);
    for (auto& c : connections_) shift(c.first);
    for (auto& m : motors_) shift(m.first);
    shift(controller_first_);
    if (effect_type(removed.name).structural()) switch_off(removed);
}

}  // namespace dualdrive
