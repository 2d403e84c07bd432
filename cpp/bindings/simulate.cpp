#include "dualdrive/simulate.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <stdexcept>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dualdrive/balance.hpp"
#include "dualdrive/recorder.hpp"
#include "options.hpp"

namespace dualdrive::python {

namespace {

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

std::vector<double> vector_of(const Doubles& a) { return {a.data(), a.data() + a.shape(0)}; }

// Asks Python for a pending Ctrl-C, at most every 50 ms, while the simulation runs without the GIL.
std::function<bool()> signal_check() {
    using Clock = std::chrono::steady_clock;
    return [last = Clock::now()]() mutable {
        if (Clock::now() - last < std::chrono::milliseconds(50)) return false;
        last = Clock::now();
        const nb::gil_scoped_acquire gil;
        return PyErr_CheckSignals() != 0;
    };
}

Trajectory run(const Machine& machine, const Inputs& inputs, double end, double start, double output_step,
               const std::vector<double>& times, const std::string& engine, double rtol, const std::string& method,
               bool long_double, double longest_step, long max_steps, const std::vector<std::string>& signals,
               const std::vector<std::string>& sensitivities, const std::vector<std::string>& gradient,
               const std::map<std::string, double>& initial, bool energy) {
    SimulateOptions o;
    o.start = start;
    o.end = end;
    o.output_step = output_step;
    o.times = times;
    o.engine = engine_of(engine);
    o.rtol = rtol;
    o.method = method_of(method);
    o.long_double = long_double;
    o.longest_step = longest_step;
    o.max_steps = max_steps;
    o.signals = signals;
    o.sensitivities = sensitivities;
    o.gradient = gradient;
    o.initial = initial;
    o.energy = energy;
    o.interrupted = signal_check();
    Trajectory t;
    {
        const nb::gil_scoped_release unlocked;
        t = simulate(machine, inputs, o);
    }
    if (PyErr_Occurred()) throw nb::python_error();  // Ctrl-C
    return t;
}

nb::typed<nb::dict, std::string, nb::any> statistics(const Trajectory& t) {
    const auto& s = t.statistics;
    nb::dict d;
    d["steps"] = s.steps;
    d["rhs"] = s.rhs;
    d["jacobians"] = s.jacobians;
    d["guards"] = s.guards;
    d["restarts"] = s.restarts;
    d["error_test_failures"] = s.error_test_failures;
    d["grazing"] = s.grazing;
    d["method"] = s.method;
    if (!t.work.empty()) d["energy_error"] = s.energy_error;  // not kept without the ledger
    return d;
}

Array<double> pull_back(const Trajectory& t,
                        nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu> seeds) {
    if (!t.pull_back)
        throw std::invalid_argument(t.status == Status::success
                                        ? "pull_back: this run kept no tape; name its parameters in gradient"
                                        : "pull_back: this run stopped early; a gradient needs it whole");
    if (seeds.shape(0) != t.t.size() || seeds.shape(1) != t.signals.size())
        throw std::invalid_argument("pull_back: seeds of shape " + std::to_string(seeds.shape(0)) + " x " +
                                    std::to_string(seeds.shape(1)) + " for " + std::to_string(t.t.size()) +
                                    " times x " + std::to_string(t.signals.size()) + " signals");
    const std::vector<double> all(seeds.data(), seeds.data() + seeds.size());
    std::vector<double> gradient;
    {
        const nb::gil_scoped_release unlocked;
        gradient = t.pull_back(all);
    }
    const std::size_t n = gradient.size();
    return array(std::move(gradient), {n});
}

using EventTuple = nb::typed<nb::tuple, double, std::string, std::string, std::string>;

nb::typed<nb::list, EventTuple> events(const Trajectory& t) {
    nb::list l;
    for (const auto& e : t.events) {
        const Switch& s = t.elements[static_cast<std::size_t>(e.element)];
        l.append(nb::make_tuple(e.t, s.name, mode_name(s.kind, e.from), mode_name(s.kind, e.to)));
    }
    return l;
}

}  // namespace

void bind_simulate(nb::module_& m) {
    nb::class_<Trajectory>(m, "Trajectory",
                           "What a simulation leaves. Arrays have one row per output time; units are SI.")
        .def_prop_ro(
            "t", [](const Trajectory& t) { return view(t.t, {t.t.size()}); }, "Output times in s, shape (n,).")
        .def_prop_ro("names",
                     [](const Trajectory& t) {
                         std::vector<std::string> l;
                         for (const auto& s : t.signals) l.push_back(s.name);
                         return l;
                     })
        .def_prop_ro("units",
                     [](const Trajectory& t) {
                         std::vector<std::string> l;
                         for (const auto& s : t.signals) l.push_back(s.unit);
                         return l;
                     })
        .def_prop_ro("long_names",
                     [](const Trajectory& t) {
                         std::vector<std::string> l;
                         for (const auto& s : t.signals) l.push_back(s.long_name);
                         return l;
                     })
        .def_prop_ro(
            "values", [](const Trajectory& t) { return view(t.values, {t.t.size(), t.signals.size()}); },
            "Signals, shape (n, signals).")
        .def_prop_ro(
            "elements",
            [](const Trajectory& t) {
                std::vector<std::string> l;
                for (const auto& s : t.elements) l.push_back(s.name);
                return l;
            },
            "Switching elements: meshes, dry friction, limiters, signs of formulas.")
        .def_prop_ro(
            "modes", [](const Trajectory& t) { return view(t.modes, {t.t.size(), t.elements.size()}); },
            "Modes, shape (n, elements), int8.")
        .def_prop_ro("events", &events, "(time, element, from, to) of every located switch.")
        .def_prop_ro(
            "parameters", [](const Trajectory& t) { return t.parameters; }, "Of the sensitivities.")
        .def_prop_ro(
            "sensitivities",
            [](const Trajectory& t) {
                return view(t.sensitivities,
                            {t.parameters.empty() ? 0 : t.t.size(), t.signals.size(), t.parameters.size()});
            },
            "d signal / d parameter, shape (n, signals, parameters).")
        .def_prop_ro(
            "gradient_parameters", [](const Trajectory& t) { return t.gradient; }, "Of pull_back.")
        .def("pull_back", &pull_back, nb::arg("seeds"),
             "d cost / d parameter, shape (gradient_parameters,), from d cost / d value, shape (n, signals). Raises "
             "ValueError for another shape, and for a run without gradient or one that stopped early.")
        .def_prop_ro(
            "work", [](const Trajectory& t) { return view(t.work, {t.work.size() / powers, powers}); },
            "Energy put in since the start by each path of work_names, J, shape (n, 7); dissipation is negative.")
        .def_prop_ro_static(
            "work_names", [](const nb::handle&) { return std::vector<std::string>(power_names, power_names + powers); })
        .def_prop_ro("state_names", [](const Trajectory& t) { return t.state_names; })
        .def_prop_ro("final_state", [](const Trajectory& t) { return view(t.final_state, {t.final_state.size()}); })
        .def_prop_ro("status", [](const Trajectory& t) { return std::string(status_name(t.status)); })
        .def_prop_ro(
            "message", [](const Trajectory& t) { return t.message; },
            "What went wrong and what to try; empty on success.")
        .def_prop_ro("statistics", &statistics);

    m.def("simulate", &run, nb::arg("machine"), nb::arg("inputs"), nb::kw_only(), nb::arg("end"),
          nb::arg("start") = 0.0, nb::arg("output_step") = 1e-3, nb::arg("times") = nb::list(),
          nb::arg("engine") = "auto", nb::arg("rtol") = SimulateOptions{}.rtol, nb::arg("method") = "auto",
          nb::arg("long_double") = false, nb::arg("longest_step") = 0.0,
          nb::arg("max_steps") = SimulateOptions{}.max_steps, nb::arg("signals") = nb::list(),
          nb::arg("sensitivities") = nb::list(), nb::arg("gradient") = nb::list(), nb::arg("initial") = nb::dict(),
          nb::arg("energy") = true,
          "Integrate a machine with every switch located.\n\n"
          "inputs: name -> Waveform (theta_ref, T_load, U_n or T_n of an uncontrolled machine, columns a formula "
          "reads). Times in s.\n"
          "sensitivities: parameter paths or groups, or initial.<state>. gradient: the same, for "
          "Trajectory.pull_back. initial: state -> value, others 0. The GIL is released.\n"
          "Raises ValueError for input that makes no sense, KeyboardInterrupt on Ctrl-C; a failed integration is a "
          "status.");

    m.def("recorded_channels", &recorded_channels, nb::arg("machine"),
          "Channels that effects of this machine sit at, outside the loop: sensor_delay@theta_1 and its like.");
    m.def(
        "recorder_delay",
        [](const Machine& machine, const std::string& channel, const std::vector<std::string>& parameters) {
            RecorderDelay late = recorder_delay(machine, channel, parameters);
            const std::size_t np = late.slopes.size();
            return std::make_pair(late.time, array(std::move(late.slopes), {np}));
        },
        nb::arg("machine"), nb::arg("channel"), nb::arg("parameters") = nb::list(),
        "How late the recorder of a channel is, s, and its derivatives by these parameter paths, shape (parameters,).");
    m.def(
        "record",
        [](const Machine& machine, const std::string& channel, const Doubles& t, const Doubles& signal,
           const std::vector<std::string>& parameters) {
            Recording found = record(machine, channel, vector_of(t), vector_of(signal), parameters);
            const std::size_t rows = found.values.size(), np = parameters.size();
            return std::make_tuple(array(std::move(found.values), {rows}), array(std::move(found.by_signal), {rows}),
                                   array(std::move(found.slopes), {rows, np}));
        },
        nb::arg("machine"), nb::arg("channel"), nb::arg("t"), nb::arg("signal"), nb::arg("parameters") = nb::list(),
        "What the recorder of a channel writes down of its signal, late as it is.\n\n"
        "Returns (values, d value / d signal, d value / d parameter), shapes (n,), (n,), (n, parameters). Raises "
        "ValueError.");

    m.def("delay_of", &delay_of, nb::arg("machine"), nb::arg("label"),
          "By how much an effect makes a reading late, s. Raises ValueError for an unknown label.");
    m.def(
        "taken_back",
        [](const Machine& machine, const std::string& label, const Doubles& angle, const Doubles& speed,
           const Doubles& acceleration) {
            SensedMotion found =
                taken_back(machine, label, {vector_of(angle), vector_of(speed), vector_of(acceleration)});
            const std::size_t rows = found.angle.size();
            return std::make_tuple(array(std::move(found.angle), {rows}), array(std::move(found.speed), {rows}),
                                   array(std::move(found.acceleration), {rows}));
        },
        nb::arg("machine"), nb::arg("label"), nb::arg("angle"), nb::arg("speed"), nb::arg("acceleration"),
        "The motion (rad, rad/s, rad/s^2, shape (n,) each) that stood at the sensor of an effect when it said this.\n\n"
        "Of effects whose type is invertible; a delay is left out. Raises ValueError where a reading belongs to more "
        "than one angle.");

    m.def(
        "torque_balance",
        [](const Machine& machine, const std::map<std::string, Doubles>& channels,
           const std::vector<std::string>& parameters, double standstill) -> nb::typed<nb::dict, std::string, nb::any> {
            std::map<std::string, std::vector<double>> in;
            for (const auto& [name, a] : channels) in[name] = vector_of(a);
            Balance b;
            {
                const nb::gil_scoped_release unlocked;
                b = torque_balance(machine, in, parameters, standstill);
            }
            const std::size_t eq = b.equations.size(), rows = eq ? b.residual.size() / eq : 0;
            nb::dict d;
            d["equations"] = b.equations;
            d["residual"] = array(std::move(b.residual), {eq, rows});
            d["jacobian"] = array(std::move(b.jacobian), {eq, rows, parameters.size()});
            std::vector<std::uint8_t> still(b.standstill.begin(), b.standstill.end());
            d["standstill"] = array(std::move(still), {eq, rows});
            d["effect_names"] = b.effect_names;
            d["effects"] = array(std::move(b.effects), {b.effect_names.size(), rows});
            return d;
        },
        nb::arg("machine"), nb::arg("channels"), nb::arg("parameters") = nb::list(), nb::arg("standstill") = 0.0,
        "Evaluate the machine's laws on recorded motion, against recorded motor torque.\n\n"
        "channels: t, theta_*, omega_*, alpha_* per body, T_n per motor, all SI and of one length. Returns a dict: "
        "equations (names;\n"
        "'total' first), residual (eq, rows) = J alpha + losses - motor torque, jacobian (eq, rows, parameters), "
        "standstill (eq, rows)\n"
        "1 where dry friction is set-valued (table speed below `standstill`), effects (effects, rows). Raises "
        "ValueError.");
}

}  // namespace dualdrive::python
