#include "dualdrive/machine.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>

#include "bindings.hpp"
#include "choices.hpp"
#include "dualdrive/effects.hpp"
#include "dualdrive/layout.hpp"
#include "parameter.hpp"
#include "pickle.hpp"
#include "user_laws.hpp"

namespace dualdrive::python {

namespace {

Parameter describe(const Machine& m, std::size_t k) {
    const ParameterSlot& s = m.slots()[k];
    return {s.path,     s.unit,    s.doc,         s.bounds.low, s.bounds.high, s.bounds.low_excluded,
            s.standard, s.typical, m.values()[k], s.counted};
}

// The registry's row of an effect; null for a user's own law.
const EffectType* registered(const EffectEntry& effect) {
    for (const auto& type : effect_types())
        if (effect.name == type.text.name) return &type;
    return nullptr;
}

// Names of an effect's parameters, whether its own or lent by the part it is.
std::vector<std::string> parameter_names(const Machine& machine, const EffectEntry& effect) {
    std::vector<std::string> names;
    for (std::size_t k = effect.first; k < effect.first + effect.count; ++k)
        names.push_back(machine.slots()[k].path.substr(effect.label.size() + 1));
    if (const EffectType* type = registered(effect); type && type->structural())
        for (const Declaration& lent : type->parameters) names.emplace_back(lent.name);
    return names;
}

template <class Parts>
std::vector<std::string> names_of(const Parts& parts) {
    std::vector<std::string> names;
    for (const auto& part : parts) names.push_back(part.name);
    return names;
}

void bind_copies(nb::class_<Machine>& bound) {
    bound.def(nb::init<>())
        .def_rw("name", &Machine::name)
        .def(
            "copy", [](const Machine& self) { return Machine(self); }, "An independent copy.")
        .def("__copy__", [](const Machine& self) { return Machine(self); })
        .def("__deepcopy__", [](const Machine& self, const nb::handle&) { return Machine(self); }, nb::arg("memo"));
}

void bind_assembly(nb::class_<Machine>& bound) {
    bound
        .def("add_body", &Machine::add_body, nb::arg("name"), nb::arg("locked") = false,
             "Add a body with parameters J and b.")
        .def(
            "connect",
            [](Machine& self, const std::string& name, const std::string& driver, const std::string& driven,
               const std::string& kind, const std::string& frame) {
                self.connect(name, driver, driven, chosen(connection_kinds, name + ".kind", kind),
                             chosen(frames, name + ".frame", frame));
            },
            nb::arg("name"), nb::arg("driver"), nb::arg("driven"), nb::arg("kind") = "gap", nb::arg("frame") = "driver",
            "Join two bodies: rigid, compliant or gap. frame says in whose angle twist, stiffness and gap are given.")
        .def(
            "add_motor",
            [](Machine& self, const std::string& name, const std::string& body, const std::string& kind) {
                self.add_motor(name, body.empty() ? name : body, chosen(motor_kinds, name + ".kind", kind));
            },
            nb::arg("name"), nb::arg("body") = "", nb::arg("kind") = "armature",
            "Put a motor on a body (default: the body of the same name).")
        .def(
            "set_controller",
            [](Machine& self, const std::string& kind, const std::string& equaliser, const std::string& tension,
               const std::string& current, int speed_samples, const std::string& position_sensor) {
                self.set_controller({chosen(controller_kinds, "controller.kind", kind),
                                     chosen(targets, "controller.equaliser", equaliser),
                                     chosen(schedules, "controller.tension", tension),
                                     chosen(current_loops, "controller.current", current), speed_samples,
                                     chosen(position_sensors, "controller.position_sensor", position_sensor)});
            },
            nb::arg("kind") = "master_slave", nb::arg("equaliser") = "both", nb::arg("tension") = "constant",
            nb::arg("current") = "cascade", nb::arg("speed_samples") = 0, nb::arg("position_sensor") = "table",
            "Choose the controller's structure; its numbers are parameters controller.*.\n\n"
            "equaliser: both, slave or master gets the correction. tension: constant, falling with the load, off. "
            "current: cascade, or\n"
            "voltage for a drive without current loop. speed_samples n: speed from the mean of the last n encoder "
            "samples, differenced. position_sensor: the position loop is closed on the table's encoder, the master "
            "motor's, or both.")
        .def_prop_ro("controller_options",
                     [](const Machine& self) -> nb::typed<nb::dict, std::string, nb::any> {
                         const auto& o = self.controller();
                         nb::dict d;
                         d["kind"] = name_of(controller_kinds, o.kind);
                         d["equaliser"] = name_of(targets, o.equaliser);
                         d["tension"] = name_of(schedules, o.tension);
                         d["current"] = name_of(current_loops, o.current);
                         d["speed_samples"] = o.speed_samples;
                         d["position_sensor"] = name_of(position_sensors, o.position_sensor);
                         return d;
                     })
        .def_static(
            "choices",
            []() -> nb::typed<nb::dict, std::string, std::vector<std::string>> {
                nb::dict d;
                d["connection.kind"] = names(connection_kinds);
                d["motor.kind"] = names(motor_kinds);
                d["controller.kind"] = names(controller_kinds);
                d["controller.equaliser"] = names(targets);
                d["controller.tension"] = names(schedules);
                d["controller.current"] = names(current_loops);
                d["controller.position_sensor"] = names(position_sensors);
                return d;
            },
            "What each choice may be set to.");
}

void bind_effects(nb::class_<Machine>& bound) {
    bound
        .def(
            "add_effect",
            [](Machine& self, const std::string& name, const std::string& place) {
                return std::string(self.add_effect(name, place));
            },
            nb::arg("name"), nb::arg("place"),
            "Add an effect at a place or group of places; returns its label, the prefix of its parameters.")
        .def(
            "add_expression",
            [](Machine& self, const std::string& place, const std::string& formula,
               const std::vector<std::tuple<std::string, std::string, double>>& parameters, const Columns& columns) {
                std::vector<FormulaParameter> list;
                for (const auto& [name, unit, value] : parameters) list.push_back({name, unit, value});
                return std::string(self.add_expression(place, formula, list, columns_of(columns)));
            },
            nb::arg("place"), nb::arg("formula"), nb::arg("parameters") = nb::list(), nb::arg("columns") = nb::list(),
            "Add a user's formula as a torque on a body. parameters: (name, unit, value); columns: recorded ones that "
            "it\n"
            "reads, (name, unit).")
        .def(
            "add_spline",
            [](Machine& self, const std::string& place, const Axes& axes, const std::vector<double>& values,
               double size, const Columns& columns) {
                return std::string(self.add_spline(place, axes_of(axes), values, size, columns_of(columns)));
            },
            nb::arg("place"), nb::arg("axes"), nb::arg("values"), nb::arg("size") = 300.0,
            nb::arg("columns") = nb::list(),
            "Add a learned curve as a torque on a body, N m, over one coordinate or two; returns its label.\n\n"
            "axes: (coordinate, low, high, knots, periodic); a coordinate is t, angle, speed, a signal, or in.NAME of "
            "a\n"
            "recorded column. values: at the knots, the last axis first. size: usual size of a value. Raises "
            "ValueError.")
        .def("remove_effect", &Machine::remove_effect, nb::arg("label"))
        .def_prop_ro("effects",
                     [](const Machine& self) -> nb::typed<nb::list, nb::typed<nb::dict, std::string, nb::any>> {
                         nb::list l;
                         for (const auto& e : self.effects()) {
                             nb::dict d;
                             d["label"] = e.label;
                             d["effect"] = e.name;
                             d["place"] = e.place;
                             d["formula"] = e.formula;
                             d["axes"] = axes_from(e.axes);
                             d["columns"] = columns_from(e.columns);
                             d["reads"] = names_read(e);
                             d["members"] = e.members;
                             d["parameters"] = parameter_names(self, e);
                             const EffectType* type = registered(e);
                             d["structural"] = type && type->structural();
                             d["in_balance"] = !type || type->in_balance();
                             l.append(d);
                         }
                         return l;
                     });
}

void bind_numbers(nb::class_<Machine>& bound) {
    bound.def("get", &Machine::get, nb::arg("path"), "The value at a path, or that all members of a group agree on.")
        .def("set", &Machine::set, nb::arg("path"), nb::arg("value"),
             "Set a value (SI) by path or group; checks bounds.")
        .def(
            "parameter",
            [](const Machine& self, const std::string& path) { return describe(self, self.resolve(path).front()); },
            nb::arg("path"))
        .def(
            "members",
            [](const Machine& self, const std::string& path) {
                std::vector<std::string> l;
                for (const auto k : self.resolve(path)) l.push_back(self.slots()[k].path);
                return l;
            },
            nb::arg("path"), "The paths that a path or tie group stands for.")
        .def(
            "parameters",
            [](const Machine& self) {
                std::vector<Parameter> list;
                for (std::size_t k = 0; k < self.slots().size(); ++k) list.push_back(describe(self, k));
                return list;
            },
            "Every parameter with its declaration and value.")
        .def(
            "unread", [](const Machine& self, const std::string& path) { return self.unread(path); }, nb::arg("path"),
            "Why no law reads the number at a path, the gap of a rigid mesh say; empty where one does.");
}

void bind_views(nb::class_<Machine>& bound) {
    bound.def_prop_ro("bodies", [](const Machine& self) { return names_of(self.bodies()); })
        .def_prop_ro("connections", [](const Machine& self) { return names_of(self.connections()); })
        .def_prop_ro("motors", [](const Machine& self) { return names_of(self.motors()); })
        .def(
            "kind",
            [](const Machine& self, const std::string& name) {
                if (const int c = self.connection(name); c >= 0)
                    return name_of(connection_kinds, self.connections()[static_cast<std::size_t>(c)].kind);
                if (const int k = self.motor(name); k >= 0)
                    return name_of(motor_kinds, self.motors()[static_cast<std::size_t>(k)].kind);
                throw std::invalid_argument("no connection or motor named " + name);
            },
            nb::arg("name"))
        .def("validate", &Machine::validate, "Check what no single parameter shows. Raises ValueError.")
        .def(
            "states",
            [](const Machine& self) {
                const Layout l(self, {});
                std::vector<std::pair<std::string, std::string>> list;
                for (std::size_t k = 0; k < l.state_names.size(); ++k)
                    list.emplace_back(l.state_names[k], l.state_units[k]);
                return list;
            },
            "Names and units of the state vector.")
        .def(
            "signals",
            [](const Machine& self) {
                const Layout l(self, {});
                std::vector<std::tuple<std::string, std::string, std::string>> list;
                for (const auto& s : l.signals) list.emplace_back(s.name, s.unit, s.long_name);
                return list;
            },
            "(name, unit, long name) of every signal a run can record.");
}

}  // namespace

void bind_machine(nb::module_& m) {
    nb::class_<Machine> bound(
        m, "Machine",
        "A machine as an assembly: bodies, connections, motors, a controller, effects.\n\n"
        "Every number has a stable path (mesh_1.gap, table.J, controller.K_v) in SI units; tie groups (meshes.gap)\n"
        "reach all members. Eq. 22 and Eq. 23 of the source paper is one instance. Raises ValueError naming part, "
        "value, rule.");
    pickles(bound, machine_of);
    bind_copies(bound);
    bind_assembly(bound);
    bind_effects(bound);
    bind_numbers(bound);
    bind_views(bound);
}

}  // namespace dualdrive::python
