// The numbers of a machine: paths and groups of them, values within their bounds, and which of them a law reads.
#include <algorithm>
#include <cmath>

#include "dualdrive/effects.hpp"
#include "dualdrive/machine.hpp"
#include "dualdrive/nearest.hpp"
#include "refuse.hpp"

namespace dualdrive {

namespace {

std::string bounds_text(const Bounds& b) {
    if (std::isfinite(b.low) && std::isfinite(b.high)) return "between " + rounded(b.low) + " and " + rounded(b.high);
    if (std::isfinite(b.low)) return (b.low_excluded ? "greater than " : "at least ") + rounded(b.low);
    if (std::isfinite(b.high)) return "at most " + rounded(b.high);
    return "a number";
}

bool within(const Bounds& b, double v) { return (b.low_excluded ? v > b.low : v >= b.low) && v <= b.high; }

struct Group {
    const char* name;
    const char* member_prefix;
};
constexpr Group groups[] = {
    {"motors", "motor_"}, {"gearboxes", "gearbox_"}, {"pinions", "pinion_"}, {"meshes", "mesh_"}};

}  // namespace

std::string near_names(std::string_view wrong, const std::vector<std::string>& known) {
    std::string text;
    for (const auto& name : nearest(wrong, known)) text += (text.empty() ? ", did you mean " : " or ") + name;
    return text.empty() ? text : text + "?";
}

std::vector<std::string> Machine::members_of(std::string_view group) const {
    std::vector<std::string> found;
    const auto collect = [&](const auto& list, std::string_view prefix) {
        for (const auto& part : list)
            if (std::string_view(part.name).starts_with(prefix) &&
                std::find(found.begin(), found.end(), part.name) == found.end())
                found.push_back(part.name);
    };
    for (const auto& g : groups)
        if (group == g.name) {
            collect(bodies_, g.member_prefix);
            collect(motors_, g.member_prefix);
            collect(connections_, g.member_prefix);
        }
    return found;
}

std::vector<std::size_t> Machine::resolve(std::string_view path) const {
    std::vector<std::size_t> found;
    for (std::size_t k = 0; k < slots_.size(); ++k)
        if (slots_[k].path == path) return {k};
    found = lent(path);
    if (const auto dot = path.rfind('.'); dot != std::string_view::npos && found.empty())
        for (const auto& member : members_of(path.substr(0, dot)))
            for (std::size_t k = 0; k < slots_.size(); ++k)
                if (slots_[k].path == member + std::string(path.substr(dot))) found.push_back(k);
    if (!found.empty()) return found;
    std::vector<std::string> known;
    for (const auto& s : slots_) known.push_back(s.path);
    for (const auto& g : groups)
        for (const auto& s : slots_)
            if (s.path.starts_with(std::string(g.member_prefix) + "1."))
                known.push_back(std::string(g.name) + s.path.substr(s.path.find('.')));
    for (const auto& e : effects_)
        if (effect_type(e.name).structural())
            for (const Declaration& own : effect_type(e.name).parameters) known.push_back(e.label + "." + own.name);
    refuse("parameter " + std::string(path) + ": unknown" + near_names(path, known));
}

double Machine::get(std::string_view path) const {
    const auto members = resolve(path);
    for (const auto k : members)
        if (values_[k] != values_[members.front()])
            refuse("parameter " + std::string(path) + ": its members differ; ask for " + slots_[members.front()].path +
                   " and its like");
    return values_[members.front()];
}

void Machine::set(std::string_view path, double value) {
    const auto members = resolve(path);
    for (const auto k : members) {
        const ParameterSlot& s = slots_[k];
        if (std::isnan(value))
            refuse("parameter " + std::string(path) + ": value is not a number; give one in " + s.unit);
        if (!within(s.bounds, value) || (std::isinf(value) && !(value > 0 && s.standard == infinity)))
            refuse("parameter " + std::string(path) + ": " + rounded(value) + " " + s.unit +
                   " is out of bounds; it must be " + bounds_text(s.bounds) + (std::isinf(value) ? " and finite" : ""));
    }
    for (const auto k : members) values_[k] = value;
}

std::string Machine::unread(std::string_view path) const {
    std::string reason;
    for (const auto slot : resolve(path)) {
        reason = unread(slot);
        if (reason.empty()) return "";
    }
    return reason;
}

std::string Machine::unread(std::size_t slot) const {
    const std::string_view path = slots_[slot].path;
    for (const auto& c : connections_) {
        if (slot < c.first || slot >= c.first + parameter_count<Connection<double>>) continue;
        if (c.kind == ConnectionKind::rigid && !path.ends_with(".ratio")) return c.name + " is rigid";
        if (c.kind == ConnectionKind::compliant && path.ends_with(".gap"))
            return c.name + " is compliant, without play";
        if (c.kind == ConnectionKind::gap && path.ends_with(".preload"))
            return c.name + " has play; a preload belongs to a compliant connection";
    }
    for (const auto& m : motors_) {
        if (slot < m.first || slot >= m.first + parameter_count<Motor<double>>) continue;
        const auto numbers = read_component<Motor<double>>(values_.data() + m.first);
        const std::string_view own = path.substr(m.name.size() + 1);
        if (!own.starts_with("filter_") || own == "filter_pole") continue;
        if (numbers.filter_pole == 0.0) return m.name + " has no set-point filter, its filter_pole is 0";
        if (own == "filter_zero_damping" && numbers.filter_zero == 0.0)
            return "the set-point filter of " + m.name + " is a low-pass, its filter_zero is 0";
    }
    if (path == "controller.tau_s" && controller_.position_sensor != ControllerOptions::PositionSensor::both)
        return "the position loop reads one sensor; controller.position_sensor = both reads two";
    return "";
}

}  // namespace dualdrive
