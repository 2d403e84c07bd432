// Effects that are parts of the machine: where they may be, what they make of a joint, whose numbers they lend.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dualdrive/effects.hpp"
#include "dualdrive/machine.hpp"

namespace dualdrive {

namespace {

[[noreturn]] void refuse(const EffectType& type, const std::string& why) {
    throw std::invalid_argument(std::string("effect ") + type.text.name + ": " + why);
}

// The row of an effect that is a part; null for all others.
const EffectType* structural_type(const EffectEntry& effect) {
    for (const auto& type : effect_types())
        if (effect.name == type.text.name && type.structural()) return &type;
    return nullptr;
}

bool sits_at(const EffectEntry& effect, const std::string& member) {
    return std::find(effect.members.begin(), effect.members.end(), member) != effect.members.end();
}

bool lends(const EffectType& type, std::string_view name) {
    return std::any_of(type.parameters.begin(), type.parameters.end(),
                       [&](const Declaration& own) { return name == own.name; });
}

}  // namespace

void Machine::check_part(const EffectType& type, const std::string& member) const {
    for (const auto& e : effects_)
        if (e.name == type.text.name && sits_at(e, member))
            refuse(type, member + " has it already, as " + e.label + "; change that one");
    if (type.part == Part::joint) {
        check_joint(type, member);
        return;
    }
    if (!controlled()) refuse(type, "it is part of a controller, and this machine has none; give it one first");
    if (type.part == Part::controller && member != "controller")
        refuse(type, member + " is no place for it; it sits at controller");
    if (type.part != Part::motor) return;
    if (motor(member) < 0) refuse(type, "no motor named " + member);
    if (lends(type, "U_max") && motors_[static_cast<std::size_t>(motor(member))].kind == MotorKind::direct)
        refuse(type, member + " is a direct torque source without a circuit; choose kind = armature first");
}

void Machine::check_joint(const EffectType& type, const std::string& member) const {
    const int c = connection(member);
    if (c < 0)
        refuse(type, "no gearbox named " + member +
                         "; it is the joint between a motor and what it drives, a connection such as gearbox_1, and "
                         "this motor sits on its pinion directly");
    const ConnectionEntry& joint = connections_[static_cast<std::size_t>(c)];
    if (joint.frame == TwistFrame::driver && joint.built == ConnectionKind::gap)
        refuse(type,
               member + " is a mesh with play of its own; change " + member + ".stiffness and " + member + ".gap");
    const bool preloaded = values_[joint.first + 3] != 0.0;
    if (type.joint == ConnectionKind::gap && joint.kind == ConnectionKind::compliant && preloaded)
        refuse(type, member + " is preloaded, so it has no play; set " + member + ".preload = 0 first");
}

// A joint is as it was connected, or as loose as the effects at it ask for. One that was rigid until now has no stiffness
// worth the name, unless one was given: it gets one that is nearly rigid.
void Machine::settle_joints() {
    for (auto& joint : connections_) {
        ConnectionKind kind = joint.built;
        for (const auto& e : effects_)
            if (const EffectType* type = structural_type(e); type && sits_at(e, joint.name))
                kind = std::max(kind, type->joint);
        const std::size_t stiffness = joint.first + 1;
        const bool loosened = joint.kind == ConnectionKind::rigid && kind != ConnectionKind::rigid;
        if (loosened && values_[stiffness] == slots_[stiffness].standard) values_[stiffness] = nearly_rigid(joint);
        joint.kind = kind;
    }
}

// The stiffness with which the two bodies would ring against each other at 1 kHz: above all that a drive excites, and
// still no burden for a solver.
double Machine::nearly_rigid(const ConnectionEntry& joint) const {
    const double ring = 2.0 * std::numbers::pi * 1000.0;  // rad/s
    const double ratio = values_[joint.first];
    const auto inertia = [&](int b) { return values_[bodies_[static_cast<std::size_t>(b)].first]; };
    const bool at_driven = joint.frame == TwistFrame::driven;
    const double driver = inertia(joint.driver) * (at_driven ? ratio * ratio : 1.0);
    const double driven = inertia(joint.driven) / (at_driven ? 1.0 : ratio * ratio);
    const double both = driver > 0 && driven > 0 ? driver * driven / (driver + driven) : std::max(driver, driven);
    return both > 0 ? ring * ring * both : slots_[joint.first + 1].standard;
}

// Without its effect a limit or lag is off and a joint as it was connected; its numbers go back to their defaults where
// nothing reads them any more and no other effect lends them.
void Machine::switch_off(const EffectEntry& removed) {
    settle_joints();
    const EffectType& type = effect_type(removed.name);
    for (const auto& member : removed.members)
        for (const Declaration& own : type.parameters) {
            const std::string path = member + "." + own.name;
            const bool lent_again = std::any_of(effects_.begin(), effects_.end(), [&](const EffectEntry& e) {
                const EffectType* other = structural_type(e);
                return other && sits_at(e, member) && lends(*other, own.name);
            });
            const std::size_t slot = resolve(path).front();
            if (lent_again || (type.part == Part::joint && unread(slot).empty())) continue;
            values_[slot] = slots_[slot].standard;
        }
}

// The machine's numbers that a path of a structural effect stands for.
std::vector<std::size_t> Machine::lent(std::string_view path) const {
    const auto dot = path.rfind('.');
    std::vector<std::size_t> found;
    if (dot == std::string_view::npos) return found;
    for (const auto& e : effects_) {
        const EffectType* type = structural_type(e);
        if (!type || e.label != path.substr(0, dot) || !lends(*type, path.substr(dot + 1))) continue;
        for (const auto& member : e.members)
            for (std::size_t k = 0; k < slots_.size(); ++k)
                if (slots_[k].path == member + std::string(path.substr(dot))) found.push_back(k);
    }
    return found;
}

}  // namespace dualdrive
