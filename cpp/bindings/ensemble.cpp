// Many runs on many threads, and the reductions that sum up a run.
#include "dualdrive/ensemble.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cmath>

#include "arrays.hpp"
#include "bindings.hpp"
#include "options.hpp"

namespace dualdrive::python {

namespace {

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Column = nb::ndarray<const double, nb::ndim<1>, nb::device::cpu>;  // of a table: strided
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Window = std::tuple<std::string, double, double>;              // measure, begin, end
using Named = std::tuple<std::string, std::string, double, double>;  // signal, measure, begin, end

Scenario scenario(const Inputs& inputs, double end, double start, const std::string& engine, double rtol,
                  const std::string& method, double longest_step, long max_steps,
                  const std::map<std::string, double>& initial, bool energy, const std::vector<Named>& reductions) {
    Scenario s;
    s.inputs = inputs;
    s.options.start = start;
    s.options.end = end;
    s.options.engine = engine_of(engine);
    s.options.rtol = rtol;
    s.options.method = method_of(method);
    s.options.longest_step = longest_step;
    s.options.max_steps = max_steps;
    s.options.initial = initial;
    s.options.energy = energy;
    for (const auto& [signal, measure, from, to] : reductions)
        s.reductions.push_back({signal, measure_of(measure), from, to});
    return s;
}

void construct(Ensemble* self, const Machine& machine, const std::vector<Scenario>& scenarios,
               const std::vector<std::string>& paths, const Matrix& values, const Vector& times,
               const std::vector<std::string>& signals, std::size_t threads, bool ordered) {
    EnsemblePlan plan;
    plan.machine = machine;
    plan.scenarios = scenarios;
    plan.runs = values.shape(0);
    plan.paths = paths;
    plan.values.assign(values.data(), values.data() + values.size());
    plan.times.assign(times.data(), times.data() + times.size());
    plan.signals = signals;
    new (self) Ensemble(std::move(plan), threads, ordered ? Ensemble::Order::by_number : Ensemble::Order::as_finished);
}

// Into a list that the caller keeps: an interrupt right after the call loses nothing.
void take(Ensemble& runs, nb::list into, double patience) {
    std::vector<EnsembleRun> found;
    {
        const nb::gil_scoped_release unlocked;
        found = runs.take(std::chrono::milliseconds(std::lround(1e3 * patience)));
    }
    for (auto& run : found) into.append(nb::cast(std::move(run)));
}

std::vector<double> reduce(const Vector& t, const Column& x, const std::vector<Window>& windows) {
    if (t.shape(0) != x.shape(0))
        throw std::invalid_argument("reduce: " + std::to_string(t.shape(0)) + " times, " + std::to_string(x.shape(0)) +
                                    " values; give one value per time");
    std::vector<double> found;
    for (const auto& [measure, begin, end] : windows) {
        Reducer reducer({"", measure_of(measure), begin, end});
        reducer.add({t.data(), t.shape(0)}, x.data(), static_cast<std::size_t>(x.stride(0)));
        found.push_back(reducer.value());
    }
    return found;
}

// Modes by name, as events carry them; those that carry no torque need not be told apart.
std::tuple<long, long> count_flanks(const std::vector<std::tuple<std::string, std::string>>& switches) {
    const auto mode = [](const std::string& name) {
        for (const Mode m : {flank::front, flank::back})
            if (name == mode_name(SwitchKind::flank, m)) return m;
        return flank::gap;
    };
    FlankCount count;
    for (const auto& [from, to] : switches) count.add(mode(from), mode(to));
    return {count.contacts, count.reversals};
}

}  // namespace

void bind_ensemble(nb::module_& m) {
    nb::class_<Scenario>(m, "Scenario", "What a machine of an ensemble is put through, and what of it is summed up.")
        .def(
            "__init__",
            [](Scenario* self, const Inputs& inputs, double end, double start, const std::string& engine, double rtol,
               const std::string& method, double longest_step, long max_steps,
               const std::map<std::string, double>& initial, bool energy, const std::vector<Named>& reductions) {
                new (self) Scenario(scenario(inputs, end, start, engine, rtol, method, longest_step, max_steps, initial,
                                             energy, reductions));
            },
            nb::arg("inputs"), nb::kw_only(), nb::arg("end"), nb::arg("start") = 0.0, nb::arg("engine") = "auto",
            nb::arg("rtol") = SimulateOptions{}.rtol, nb::arg("method") = "auto", nb::arg("longest_step") = 0.0,
            nb::arg("max_steps") = SimulateOptions{}.max_steps, nb::arg("initial") = nb::dict(),
            nb::arg("energy") = true, nb::arg("reductions") = nb::list(),
            "Inputs and options as of simulate. reductions: (signal, measure, begin, end), times in s, both included;\n"
            "measures: min, max, range, peak, mean, rms, final. Raises ValueError for an unknown measure or method.");

    nb::class_<EnsembleRun>(m, "EnsembleRun", "What one run of an ensemble leaves.")
        .def_ro("number", &EnsembleRun::number)
        .def_ro("status", &EnsembleRun::status, "Of the trajectory, or 'refused'.")
        .def_ro("message", &EnsembleRun::message, "What went wrong and what to try; empty on success.")
        .def_ro("method", &EnsembleRun::method, "Of the solver.")
        .def_prop_ro(
            "numbers", [](const EnsembleRun& r) { return view(r.numbers, {r.numbers.size()}); },
            "Reductions, reversals of every connection, tallies; NaN unless the run succeeded.")
        .def(
            "signals",
            [](const EnsembleRun& r, std::size_t count) {
                return view(r.signals, {count, count ? r.signals.size() / count : 0});
            },
            nb::arg("count"), nb::rv_policy::reference_internal,
            "The `count` signals kept, shape (count, times); NaN from where the run failed.");

    nb::class_<Ensemble>(m, "Ensemble", "Many runs of one machine on many threads, in bounded memory.")
        .def("__init__", &construct, nb::arg("machine"), nb::arg("scenarios"), nb::kw_only(), nb::arg("paths"),
             nb::arg("values"), nb::arg("times"), nb::arg("signals") = nb::list(), nb::arg("threads") = 1,
             nb::arg("ordered") = false,
             "scenarios: one for all runs, or one for each. paths: parameters, tie groups or initial.<state>; values, "
             "SI,\n"
             "shape (runs, paths). times in s. signals: kept whole. The first runs begin at once. Raises ValueError.")
        .def("take", &take, nb::arg("into"), nb::arg("patience") = 0.05,
             nb::sig("def take(self, into: list[EnsembleRun], patience: float = 0.05) -> None"),
             "Append what has finished, as soon as it is a batch or `patience`, s, ends; with `ordered` in order of\n"
             "numbers. The GIL is released.")
        .def_prop_ro("done", &Ensemble::done, "Whether everything that will ever come was taken.")
        .def("stop", &Ensemble::stop, "Begin no more runs; those under way are finished and handed over.")
        .def("close", &Ensemble::close, nb::call_guard<nb::gil_scoped_release>(),
             "Cut the runs under way short and end the threads.")
        .def_prop_ro_static(
            "tallies", [](const nb::handle&) { return std::vector<std::string>(tally_names, tally_names + tallies); });

    m.def("reduce", &reduce, nb::arg("t"), nb::arg("x"), nb::arg("windows"),
          "Sum up a signal x, shape (n,), at increasing times t: one number per (measure, begin, end), as a Scenario "
          "does.\n"
          "Raises ValueError.");
    m.def("count_flanks", &count_flanks, nb::arg("switches"),
          "(contacts, reversals) of one connection's switches in order, each (mode before, mode after).");
}

}  // namespace dualdrive::python
