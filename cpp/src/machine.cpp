#include "dualdrive/machine.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "dualdrive/effects.hpp"
#include "dualdrive/expression.hpp"
#include "dualdrive/nearest.hpp"

namespace dualdrive {

namespace {

[[noreturn]] void refuse(const std::string& message) { throw std::invalid_argument(message); }

std::string number(double v) {
    std::ostringstream s;
    s.precision(9);
    s << v;
    return s.str();
}

std::string bounds_text(const Bounds& b) {
    if (std::isfinite(b.low) && std::isfinite(b.high)) return "between " + number(b.low) + " and " + number(b.high);
    if (std::isfinite(b.low)) return (b.low_excluded ? "greater than " : "at least ") + number(b.low);
    if (std::isfinite(b.high)) return "at most " + number(b.high);
    return "a number";
}

bool within(const Bounds& b, double v) { return (b.low_excluded ? v > b.low : v >= b.low) && v <= b.high; }

// The name of a recorded channel (interface: canonical names of measured traces).
bool is_channel(std::string_view name) {
    for (const std::string_view stem : {"theta_", "omega_", "I_", "U_", "T_"})
        if (name.starts_with(stem) && name.size() > stem.size()) return true;
    return false;
}

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

std::size_t Machine::declare(const std::string& prefix, const Declaration* list, std::size_t count) {
    const std::size_t first = slots_.size();
    for (std::size_t k = 0; k < count; ++k) {
        const Declaration& d = list[k];
        const std::string_view declared = d.name;
        const bool clock = declared.ends_with("_sample") || declared.ends_with("_latency");
        slots_.push_back({prefix + "." + d.name, d.unit, d.doc, d.bounds, d.standard, d.typical, clock, d.counted});
        values_.push_back(d.standard);
    }
    return first;
}

template <class Component>
std::size_t Machine::declare(const std::string& prefix) {
    std::vector<Declaration> list;
    for (const auto& f : Component::parameters()) list.push_back(f.declaration);
    return declare(prefix, list.data(), list.size());
}

void Machine::add_body(const std::string& body_name, bool locked) {
    if (body(body_name) >= 0) refuse("body " + body_name + ": a body of this name is there already");
    bodies_.push_back({body_name, declare<Body<double>>(body_name), locked});
}

void Machine::connect(const std::string& connection_name, const std::string& driver, const std::string& driven,
                      ConnectionKind kind, TwistFrame frame) {
    if (connection(connection_name) >= 0) refuse("connection " + connection_name + ": the name is taken");
    for (const auto& end : {driver, driven})
        if (body(end) < 0) refuse("connection " + connection_name + ": no body named " + end);
    if (driver == driven) refuse("connection " + connection_name + ": joins " + driver + " to itself");
    connections_.push_back(
        {connection_name, kind, frame, body(driver), body(driven), declare<Connection<double>>(connection_name), kind});
}

void Machine::add_motor(const std::string& motor_name, const std::string& body_name, MotorKind kind) {
    if (motor(motor_name) >= 0) refuse("motor " + motor_name + ": the name is taken");
    const int b = body(body_name);
    if (b < 0) refuse("motor " + motor_name + ": no body named " + body_name);
    // The chain to the table: a reducer with the motor's body as driver, then the mesh behind it.
    MotorEntry entry{motor_name, kind, b, -1, -1, 0};
    const auto driven_by = [&](int who) {
        for (std::size_t c = 0; c < connections_.size(); ++c)
            if (connections_[c].driver == who) return static_cast<int>(c);
        return -1;
    };
    const auto at = [&](int c) { return connections_[static_cast<std::size_t>(c)]; };
    const int first = driven_by(b);
    if (first >= 0 && at(first).frame == TwistFrame::driver) {
        entry.mesh = first;
    } else if (first >= 0) {
        entry.gearbox = first;
        entry.mesh = driven_by(at(first).driven);
    }
    entry.first = declare<Motor<double>>(motor_name);
    motors_.push_back(entry);
}

void Machine::set_controller(const ControllerOptions& options) {
    if (!controlled() && options.kind != ControllerOptions::Kind::none && controller_first_ == 0)
        controller_first_ = declare<Controller<double>>("controller");
    controller_ = options;
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

const std::string& Machine::add_effect(const std::string& effect_name, const std::string& place) {
    const EffectType& type = effect_type(effect_name);
    if (is_user_law(type))
        refuse("effect " + effect_name + ": it is written by its user; give " +
               (effect_name == "spline" ? "coordinate, low, high and values" : "a formula and its parameters"));
    EffectEntry entry{effect_name, place, "", members_of(place), "", 0, type.parameters.size()};
    if (entry.members.empty()) entry.members = {place};
    const bool on_body = type.hooks & (hook::body | hook::friction | hook::inertia);
    const bool on_mesh = type.hooks & hook::mesh;
    const bool in_motor = type.hooks & (hook::motor | hook::voltage | hook::estimate);
    for (auto& m : entry.members) {
        if (on_body && m == "ring") m = "table";
        if (on_body && body(m) < 0)
            refuse("effect " + effect_name + ": no body named " + m +
                   " to act on; bodies are motor_n, pinion_n, table");
        if (in_motor && motor(m) < 0) refuse("effect " + effect_name + ": no motor named " + m);
        if (type.hooks & hook::voltage && motors_[static_cast<std::size_t>(motor(m))].kind == MotorKind::direct)
            refuse("effect " + effect_name + ": " + m +
                   " is a direct torque source without a circuit; choose kind = armature first");
        if (on_mesh && !shapes_a_mesh(m))
            refuse("effect " + effect_name + ": " + m +
                   " is no place for it; it acts at a mesh or gearbox that is not rigid, at a pinion, or at the ring");
        if (type.text.makes_play && !shapes_a_mesh(m, true))
            refuse("effect " + effect_name + ": " + m + " has no connection with play; set kind = gap there first");
        const bool sensor = type.hooks & (hook::reading | hook::delay);
        if (sensor && m != "table" && motor(m) < 0 && !is_channel(m))
            refuse("effect " + effect_name + ": " + m +
                   " is no sensor; it sits at table or motor_n (inside the loop), or at a recorded channel such as "
                   "theta_m");
        if (type.text.of_angle && is_channel(m) && !m.starts_with("theta_"))
            refuse("effect " + effect_name + ": " + m +
                   " is no angle; it sits at a channel such as theta_m or theta_1");
        if (type.structural()) check_part(type, m);
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
    EffectEntry entry = user_law("expression", place, parameters.size(), columns);
    entry.formula = formula;
    const std::string& label = append_effect(std::move(entry));
    effects_.back().first = slots_.size();
    for (const auto& p : parameters) {
        if (!std::isfinite(p.value)) refuse("effect " + label + ": parameter " + p.name + " is not finite");
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
            refuse("effect spline: " + axis.coordinate + ": low = " + number(axis.low) +
                   " must lie below high = " + number(axis.high) + ", both finite");
        if (axis.knots < fewest || axis.knots > 1000)
            refuse("effect spline: " + axis.coordinate + ": " + std::to_string(axis.knots) + " knots; give between " +
                   std::to_string(fewest) + " and 1000");
        count *= static_cast<std::size_t>(axis.knots);
    }
    if (values.size() != count)
        refuse("effect spline: " + std::to_string(values.size()) + " values for " + std::to_string(count) + " knots");
    if (!(usual_size > 0) || std::isinf(usual_size))
        refuse("effect spline: size = " + number(usual_size) + " N*m must be positive and finite");
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

void Machine::remove_effect(const std::string& label) {
    const auto it =
        std::find_if(effects_.begin(), effects_.end(), [&](const EffectEntry& e) { return e.label == label; });
    if (it == effects_.end()) {
        std::vector<std::string> known;
        for (const auto& e : effects_) known.push_back(e.label);
        refuse("effect " + label + ": not in this machine" + near_names(label, known));
    }
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
            refuse("parameter " + std::string(path) + ": " + number(value) + " " + s.unit +
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
    return "";
}

int Machine::body(std::string_view wanted) const {
    for (std::size_t k = 0; k < bodies_.size(); ++k)
        if (bodies_[k].name == wanted) return static_cast<int>(k);
    return -1;
}
int Machine::connection(std::string_view wanted) const {
    for (std::size_t k = 0; k < connections_.size(); ++k)
        if (connections_[k].name == wanted) return static_cast<int>(k);
    return -1;
}
int Machine::motor(std::string_view wanted) const {
    for (std::size_t k = 0; k < motors_.size(); ++k)
        if (motors_[k].name == wanted) return static_cast<int>(k);
    return -1;
}

void Machine::validate() const {
    if (bodies_.empty()) refuse("machine: no bodies");
    for (const auto& e : effects_)
        for (const auto& m : e.members)
            if (effect_type(e.name).text.of_rating && !std::isfinite(get(m + ".T_rated")))
                refuse("effect " + e.label + ": it is measured against the rated torque; set " + m + ".T_rated");
    if (!controlled()) return;
    if (motors_.empty()) refuse("controller: the machine has no motor to command");
    if (body("table") < 0)
        refuse("controller: the machine has no body named table, whose angle the position loop reads");
    const Controller<double> c = read_component<Controller<double>>(values_.data() + controller_first_);
    const auto latency = [](double delay, double sample, const char* loop) {
        if (delay > 0 && sample == 0)
            refuse(std::string("controller.") + loop + "_latency: needs a sample time; set controller." + loop +
                   "_sample");
        if (delay > sample)
            refuse(std::string("controller.") + loop + "_latency: " + number(delay) + " s exceeds the sample time " +
                   number(sample) + " s");
    };
    latency(c.position_latency, c.position_sample, "position");
    latency(c.tension_latency, c.tension_sample, "tension");
    latency(c.speed_latency, c.speed_sample, "speed");
    latency(c.current_latency, c.current_sample, "current");
    if (controller_.speed_samples < 0)
        refuse("controller.speed_samples: " + std::to_string(controller_.speed_samples) + " must be at least 0");
    if (controller_.speed_samples > 0 && c.speed_sample == 0)
        refuse(
            "controller.speed_samples: a differenced encoder needs a sampled speed loop; set controller.speed_sample");
    // A filter stepped by forward Euler swings ever wider from two filter times per sample on.
    const auto filter = [](double time, double sample, const char* filter_name, const char* sample_name) {
        if (time > 0 && sample >= 2.0 * time)
            refuse(std::string("controller.") + sample_name + ": " + number(sample) +
                   " s is no sample time for the filter controller." + filter_name + " = " + number(time) +
                   " s; sample faster than twice per filter time, or filter longer");
    };
    if (c.K_d > 0) filter(c.tau_d, c.position_sample, "tau_d", "position_sample");
    if (motors_.size() > 1) filter(c.tau_t, c.tension_sample, "tau_t", "tension_sample");
    for (const auto& e : effects_) {
        const EffectText& text = effect_type(e.name).text;
        if (!text.rounds) continue;
        for (const auto& m : e.members) {
            if (m == "table" && c.position_sample == 0)
                refuse("effect " + e.label +
                       ": a continuous position loop would switch at every count; set controller.position_sample, or "
                       "place it at the recorded channel theta_m");
            if (motor(m) >= 0 && controller_.speed_samples == 0)
                refuse("effect " + e.label + ": the drive of " + m +
                       " reads a speed without counts; set controller.speed_samples and speed_sample, or place it at a "
                       "recorded channel");
        }
    }
    if (controller_.speed_samples > 0)
        for (const auto& e : effects_) {
            const EffectType& type = effect_type(e.name);
            if (!(type.hooks & (hook::reading | hook::delay)) || type.text.of_angle || type.text.rounds) continue;
            for (const auto& m : e.members)
                if (motor(m) >= 0)
                    refuse("effect " + e.label + ": with controller.speed_samples = " +
                           std::to_string(controller_.speed_samples) + " the drive differences the encoder of " + m +
                           " and reads no speed sensor; set speed_samples = 0 or move the effect to table");
        }
    for (const auto& m : motors_) {
        const bool falling = m.kind == MotorKind::direct && motors_.size() > 1 && c.speed_sample == 0 &&
                             controller_.tension == ControllerOptions::Schedule::falling;
        if (falling)
            refuse("motor " + m.name +
                   ": a direct torque source under continuous speed loops has no torque of its own that a falling "
                   "tension could follow; use kind = armature, a sampled speed loop, or another tension");
        const bool loop = m.kind == MotorKind::direct && motors_.size() > 1 && c.g_E > 0;
        if (loop && c.speed_sample == 0 && c.tension_sample == 0)
            refuse("motor " + m.name +
                   ": a direct torque source under a continuous torque equaliser is an algebraic loop; "
                   "use kind = armature, a sampled loop, or controller.g_E = 0");
    }
}

}  // namespace dualdrive
