// A machine travels as the calls that put it together, in their order, and the numbers that differ from the defaults.
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <stdexcept>

#include "pickle.hpp"
#include "user_laws.hpp"

namespace dualdrive::python {

namespace nb = nanobind;

namespace {

using OwnNumbers = std::vector<std::tuple<std::string, std::string, double>>;  // of a user's law: name, unit, value
using Options = std::tuple<int, int, int, int, int, int>;

struct Call {
    std::size_t first;  // of the numbers it declares: calls were made in this order
    nb::tuple words;
};

template <class E>
int number(E choice) {
    return static_cast<int>(choice);
}

Options options_of(const ControllerOptions& o) {
    return {number(o.kind),    number(o.equaliser), number(o.tension),
            number(o.current), o.speed_samples,     number(o.position_sensor)};
}

ControllerOptions controller_of(const Options& given) {
    const auto [kind, equaliser, tension, current, speed_samples, sensor] = given;
    return {static_cast<ControllerOptions::Kind>(kind),
            static_cast<ControllerOptions::Target>(equaliser),
            static_cast<ControllerOptions::Schedule>(tension),
            static_cast<ControllerOptions::CurrentLoop>(current),
            speed_samples,
            static_cast<ControllerOptions::PositionSensor>(sensor)};
}

OwnNumbers own_numbers(const Machine& machine, const EffectEntry& effect) {
    OwnNumbers numbers;
    if (!effect.of_user()) return numbers;
    for (std::size_t k = effect.first; k < effect.first + effect.count; ++k) {
        const ParameterSlot& slot = machine.slots()[k];
        numbers.emplace_back(slot.path.substr(effect.label.size() + 1), slot.unit, slot.standard);
    }
    return numbers;
}

std::vector<Call> calls_of(const Machine& machine) {
    std::vector<Call> calls;
    const auto name = [&](int body) { return machine.bodies()[static_cast<std::size_t>(body)].name; };
    for (const auto& b : machine.bodies()) calls.push_back({b.first, nb::make_tuple("body", b.name, b.locked)});
    for (const auto& c : machine.connections())
        calls.push_back({c.first, nb::make_tuple("connection", c.name, name(c.driver), name(c.driven), number(c.built),
                                                 number(c.frame))});
    for (const auto& m : machine.motors())
        calls.push_back({m.first, nb::make_tuple("motor", m.name, name(m.body), number(m.kind))});
    for (std::size_t k = 0; k < machine.slots().size(); ++k)
        if (machine.slots()[k].path.starts_with("controller.")) {
            calls.push_back({k, nb::make_tuple("controller")});
            break;
        }
    for (const auto& e : machine.effects()) {
        const double size = e.axes.empty() ? 0.0 : machine.slots()[e.first].typical;
        calls.push_back({e.first, nb::make_tuple("effect", e.name, e.place, e.label, e.formula, own_numbers(machine, e),
                                                 axes_from(e.axes), size, columns_from(e.columns))});
    }
    std::stable_sort(calls.begin(), calls.end(), [](const Call& a, const Call& b) { return a.first < b.first; });
    return calls;
}

std::string add_as_told(Machine& machine, const nb::tuple& words) {
    const auto name = nb::cast<std::string>(words[1]), place = nb::cast<std::string>(words[2]);
    const auto formula = nb::cast<std::string>(words[4]);
    const auto axes = axes_of(nb::cast<Axes>(words[6]));
    const auto columns = columns_of(nb::cast<Columns>(words[8]));
    if (formula.empty() && axes.empty()) return machine.add_effect(name, place);
    std::vector<FormulaParameter> parameters;
    std::vector<double> values;
    for (const auto& [own, unit, value] : nb::cast<OwnNumbers>(words[5])) {
        parameters.push_back({own, unit, value});
        values.push_back(value);
    }
    if (axes.empty()) return machine.add_expression(place, formula, parameters, columns);
    return machine.add_spline(place, axes, values, nb::cast<double>(words[7]), columns);
}

// A label counts up past those that are taken: fillers stand in for effects that were removed meanwhile.
void add_labelled(Machine& machine, const nb::tuple& words) {
    const auto label = nb::cast<std::string>(words[3]);
    std::vector<std::string> fillers;
    while (true) {
        const std::string given = add_as_told(machine, words);
        if (given == label) break;
        if (given.size() > label.size()) throw std::invalid_argument("machine: no effect has the label " + label);
        fillers.push_back(given);
    }
    for (const auto& filler : fillers) machine.remove_effect(filler);
}

void repeat(Machine& machine, const nb::tuple& words) {
    const auto what = nb::cast<std::string>(words[0]);
    const auto text = [&](std::size_t k) { return nb::cast<std::string>(words[k]); };
    if (what == "body") {
        machine.add_body(text(1), nb::cast<bool>(words[2]));
    } else if (what == "connection") {
        machine.connect(text(1), text(2), text(3), static_cast<ConnectionKind>(nb::cast<int>(words[4])),
                        static_cast<TwistFrame>(nb::cast<int>(words[5])));
    } else if (what == "motor") {
        machine.add_motor(text(1), text(2), static_cast<MotorKind>(nb::cast<int>(words[3])));
    } else if (what == "controller") {
        ControllerOptions declared;
        declared.kind = ControllerOptions::Kind::master_slave;
        machine.set_controller(declared);
    } else if (what == "effect") {
        add_labelled(machine, words);
    } else {
        throw std::invalid_argument("machine: '" + what + "' is no part of one");
    }
}

}  // namespace

nb::tuple state_of(const Machine& machine) {
    nb::list calls;
    for (const Call& call : calls_of(machine)) calls.append(call.words);
    return nb::make_tuple(machine.name, calls, options_of(machine.controller()), machine.values());
}

Machine machine_of(const nb::tuple& state) {
    Machine machine;
    machine.name = nb::cast<std::string>(state[0]);
    for (const nb::handle words : nb::cast<nb::list>(state[1])) repeat(machine, nb::cast<nb::tuple>(words));
    // a controller that was taken out keeps its numbers; one that never was has none to declare
    const ControllerOptions options = controller_of(nb::cast<Options>(state[2]));
    if (options.kind != machine.controller().kind || machine.controlled()) machine.set_controller(options);
    const auto values = nb::cast<std::vector<double>>(state[3]);
    if (values.size() != machine.slots().size()) throw std::invalid_argument("machine: not as many numbers as it has");
    for (std::size_t k = 0; k < values.size(); ++k)  // a default may lie out of bounds: it is to be replaced
        if (values[k] != machine.values()[k]) machine.set(machine.slots()[k].path, values[k]);
    return machine;
}

}  // namespace dualdrive::python
