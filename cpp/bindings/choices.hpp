// What a machine leaves to choose, by the names that Python gives it.
#pragma once

#include <nanobind/nanobind.h>

#include <stdexcept>
#include <string>

#include "dualdrive/machine.hpp"

namespace dualdrive::python {

namespace nb = nanobind;

template <class E>
struct Choice {
    const char* name;
    E value;
};

template <class E, std::size_t N>
E chosen(const Choice<E> (&choices)[N], const std::string& what, const std::string& name) {
    std::string known;
    for (const auto& c : choices) {
        if (name == c.name) return c.value;
        known += (known.empty() ? "" : ", ") + std::string(c.name);
    }
    throw std::invalid_argument(what + " = '" + name + "' is unknown; choose one of " + known);
}

template <class E, std::size_t N>
std::string name_of(const Choice<E> (&choices)[N], E value) {
    for (const auto& c : choices)
        if (c.value == value) return c.name;
    return "?";
}

inline constexpr Choice<ConnectionKind> connection_kinds[] = {
    {"rigid", ConnectionKind::rigid}, {"compliant", ConnectionKind::compliant}, {"gap", ConnectionKind::gap}};
inline constexpr Choice<TwistFrame> frames[] = {{"driver", TwistFrame::driver}, {"driven", TwistFrame::driven}};
inline constexpr Choice<MotorKind> motor_kinds[] = {{"armature", MotorKind::armature}, {"direct", MotorKind::direct}};
inline constexpr Choice<ControllerOptions::Kind> controller_kinds[] = {
    {"none", ControllerOptions::Kind::none}, {"master_slave", ControllerOptions::Kind::master_slave}};
inline constexpr Choice<ControllerOptions::Target> targets[] = {{"both", ControllerOptions::Target::both},
                                                                {"slave", ControllerOptions::Target::slave},
                                                                {"master", ControllerOptions::Target::master}};
inline constexpr Choice<ControllerOptions::Schedule> schedules[] = {{"constant", ControllerOptions::Schedule::constant},
                                                                    {"falling", ControllerOptions::Schedule::falling},
                                                                    {"off", ControllerOptions::Schedule::off}};
inline constexpr Choice<ControllerOptions::CurrentLoop> current_loops[] = {
    {"cascade", ControllerOptions::CurrentLoop::cascade}, {"voltage", ControllerOptions::CurrentLoop::voltage}};
inline constexpr Choice<ControllerOptions::PositionSensor> position_sensors[] = {
    {"table", ControllerOptions::PositionSensor::table},
    {"motor", ControllerOptions::PositionSensor::motor},
    {"both", ControllerOptions::PositionSensor::both}};

template <class E, std::size_t N>
nb::list names(const Choice<E> (&choices)[N]) {
    nb::list l;
    for (const auto& c : choices) l.append(c.name);
    return l;
}

}  // namespace dualdrive::python
