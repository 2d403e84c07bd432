// The registry of effects, and what can be asked of a formula without a machine.
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dualdrive/effects.hpp"
#include "dualdrive/expression.hpp"
#include "dualdrive/unit.hpp"
#include "parameter.hpp"

namespace dualdrive::python {

namespace {

std::string hook_names(unsigned hooks) {
    std::string text;
    const auto add = [&](unsigned h, const char* name) {
        if (hooks & h) text += (text.empty() ? "" : ", ") + std::string(name);
    };
    add(hook::body, "body torque");
    add(hook::friction, "dry friction");
    add(hook::mesh, "mesh");
    add(hook::motor, "motor torque");
    add(hook::reading, "sensor reading");
    add(hook::delay, "sensor delay");
    add(hook::inertia, "inertia");
    add(hook::voltage, "motor voltage");
    add(hook::estimate, "torque estimate");
    return text;
}

// What an effect acts on: the hooks of its law, or the part of the machine that it is.
std::string acts_on(const EffectType& type) {
    switch (type.part) {
        case Part::motor:
            return "drive limit";
        case Part::joint:
            return "drive train";
        case Part::controller:
            return "command delay";
        case Part::none:
            break;
    }
    return hook_names(type.hooks);
}

}  // namespace

void bind_effect_types(nb::module_& m) {
    nb::class_<Parameter>(m, "Parameter",
                          "One declared number of a machine: path, unit (SI), bounds, default, doc, value.")
        .def_ro("path", &Parameter::path)
        .def_ro("unit", &Parameter::unit)
        .def_ro("doc", &Parameter::doc)
        .def_ro("low", &Parameter::low)
        .def_ro("high", &Parameter::high)
        .def_ro("low_excluded", &Parameter::low_excluded, "True where the lower bound itself is not allowed.")
        .def_ro("standard", &Parameter::standard, "The default.")
        .def_ro("typical", &Parameter::typical, "A usual size: prior width, step scale.")
        .def_ro("value", &Parameter::value)
        .def_ro("counted", &Parameter::counted, "Counted, chosen or read off: not fitted unless it is named.");

    nb::class_<HypothesisText>(m, "HypothesisText", "What an effect means where it may be what a machine lacks.")
        .def_prop_ro(
            "called", [](const HypothesisText& h) { return std::string(h.called); },
            "As engineers call it; empty where that is its name.")
        .def_prop_ro(
            "untried", [](const HypothesisText& h) { return std::string(h.untried); },
            "Why no search puts it in; empty where one does.")
        .def_prop_ro(
            "places", [](const HypothesisText& h) { return std::string(h.places); },
            "Where a search puts it in, comma-separated; empty: at all its usual places.")
        .def_prop_ro(
            "contains", [](const HypothesisText& h) { return std::string(h.contains); },
            "Simpler laws that it is at a limit of its numbers, comma-separated, the nearest first.")
        .def_prop_ro(
            "carrier", [](const HypothesisText& h) { return std::string(h.carrier); },
            "What multiplies its harmonics: torque of the drive, direction of motion, or nothing.")
        .def_prop_ro(
            "modulates", [](const HypothesisText& h) { return std::string(h.modulates); },
            "Number of its body of which its wave is a fraction; empty: of none.")
        .def_ro("lowest_order", &HypothesisText::lowest_order, "Below it a harmonic is another law's.")
        .def_ro("friction", &HypothesisText::friction, "Friction beside the laws of dry friction.")
        .def_ro("causes", &HypothesisText::causes, "Whether every number is a cause of its own.")
        .def_ro("clips", &HypothesisText::clips, "Whether a signal that stands at an extreme may be its doing.")
        .def_ro("scales", &HypothesisText::scales,
                "Whether it is, in a torque balance, a factor of all inertias and frictions.");

    nb::class_<EffectType>(m, "EffectType", "A physical effect of the registry: what can be added to a machine.")
        .def_prop_ro("name", [](const EffectType& e) { return std::string(e.text.name); })
        .def_prop_ro("equation", [](const EffectType& e) { return std::string(e.text.equation); })
        .def_prop_ro("source", [](const EffectType& e) { return std::string(e.text.source); })
        .def_prop_ro("validity", [](const EffectType& e) { return std::string(e.text.validity); })
        .def_prop_ro("confused_with", [](const EffectType& e) { return std::string(e.text.confused_with); })
        .def_prop_ro("brings", [](const EffectType& e) { return std::string(e.text.brings); })
        .def_prop_ro("places", [](const EffectType& e) { return std::string(e.text.places); })
        .def_prop_ro("hypothesis", [](const EffectType& e) { return e.text.hypothesis; })
        .def_prop_ro(
            "by_load", [](const EffectType& e) { return e.text.by_load; }, "Whether it needs the torque of a mesh.")
        .def_prop_ro("invertible", &EffectType::invertible, "Whether the motion follows from what such a sensor says.")
        .def_prop_ro("affine", [](const EffectType& e) { return e.text.affine; })
        .def_prop_ro("acts_on", &acts_on)
        .def_ro("memory", &EffectType::memory, "How many states of its own it brings: bristles that bend, for one.")
        .def_prop_ro("structural", &EffectType::structural,
                     "Whether it is a part of the machine, its parameters one value with that part's.")
        .def_prop_ro("in_balance", &EffectType::in_balance, "Whether a torque balance on recorded motion contains it.")
        .def_prop_ro("parameters", [](const EffectType& e) {
            std::vector<Parameter> list;
            for (const auto& d : e.parameters)
                list.push_back({d.name, d.unit, d.doc, d.bounds.low, d.bounds.high, d.bounds.low_excluded, d.standard,
                                d.typical, d.standard, d.counted});
            return list;
        });
    m.def(
        "effect_types", [] { return std::vector<EffectType>(effect_types()); },
        "Every registered effect, in registry order.");
    m.def(
        "user_laws", [] { return std::vector<EffectType>(user_laws()); },
        "Effects whose law a user writes without a compiler, in a machine file: expression and spline.");
    m.def(
        "formula_unit",
        [](const std::string& formula, const std::map<std::string, std::string>& units) {
            const auto unit_of = [&](std::string_view name) {
                const auto known = units.find(std::string(name));
                if (known == units.end())
                    throw std::invalid_argument("formula: the unit of " + std::string(name) + " is not given");
                return Unit::parse(known->second);
            };
            return Expression::parse(formula).unit(unit_of).text();
        },
        nb::arg("formula"), nb::arg("units"),
        "The unit of a formula whose names have these units (name -> SI unit; rad counts as a number).\n\n"
        "Raises ValueError naming the part of the formula whose units contradict each other.");
    m.def(
        "formula_names", [](const std::string& formula) { return Expression::parse(formula).names(); },
        nb::arg("formula"),
        "The names a formula reads. Raises ValueError naming column and rule where it can't be read.");
    m.def(
        "effect_type", [](const std::string& name) { return EffectType(effect_type(name)); }, nb::arg("name"),
        "The effect of that name, users' laws included.\n\nRaises ValueError naming the nearest known effects.");
    m.def(
        "eased",
        [](std::vector<double> x) {
            for (double& own : x) own = CuttingTorque<double>::eased(own);
            const std::size_t count = x.size();
            return array(std::move(x), {count});
        },
        nb::arg("x"),
        "How a load sets in, from 0 to 1: S of the law cutting_torque, at each of these parts of its rise.");
}

}  // namespace dualdrive::python
