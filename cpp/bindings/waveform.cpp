// Input signals: dualdrive::Waveform and the builders of motion.hpp.
#include "dualdrive/waveform.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/operators.h>
#include <nanobind/stl/vector.h>

#include "dualdrive/motion.hpp"
#include "pickle.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace dualdrive {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

using Numbers = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

// Whatever numpy can read as numbers: a list, a scalar, an array of any shape and type.
Numbers numbers(const nb::object& given) {
    const nb::object asarray = nb::module_::import_("numpy").attr("asarray");
    return nb::cast<Numbers>(asarray(given, "dtype"_a = "float64", "order"_a = "C"));
}

// A list of numbers, for an argument of the given name.
std::vector<double> list(const nb::object& given, const char* name) {
    const Numbers array = numbers(given);
    if (array.ndim() != 1) throw nb::value_error((std::string(name) + " must be one-dimensional").c_str());
    return {array.data(), array.data() + array.size()};
}

nb::object array_of(std::vector<double> values, std::vector<std::size_t> shape) {
    auto* kept = new std::vector<double>(std::move(values));
    const nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
    return nb::cast(nb::ndarray<nb::numpy, double>(kept->data(), shape.size(), shape.data(), owner));
}

nb::object array_of(std::vector<double> values) {
    const std::size_t size = values.size();
    return array_of(std::move(values), {size});
}

// f over times of any shape; a number for a number.
template <class F>
nb::object over(const nb::object& times, F f) {
    const Numbers t = numbers(times);
    if (t.ndim() == 0) return nb::float_(f(*t.data()));
    std::vector<double> values(t.size());
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = f(t.data()[k]);
    std::vector<std::size_t> shape;
    for (std::size_t k = 0; k < t.ndim(); ++k) shape.push_back(t.shape(k));
    return array_of(std::move(values), std::move(shape));
}

std::vector<Polynomial> polynomials(const nb::object& pieces) {
    const Numbers rows = numbers(pieces);
    if (rows.ndim() != 2 || rows.shape(1) < 1 || rows.shape(1) > polynomial_terms)
        throw nb::value_error("pieces must be an array of one row per piece and 1 to 6 columns");
    std::vector<Polynomial> list(rows.shape(0), Polynomial{});
    for (std::size_t k = 0; k < list.size(); ++k)
        for (std::size_t j = 0; j < rows.shape(1); ++j) list[k][j] = rows.data()[k * rows.shape(1) + j];
    return list;
}

void bind_class(nb::module_& m) {
    nb::class_<Waveform> bound(m, "Waveform", R"(An input signal over time: polynomial pieces plus harmonics. Immutable.

A commanded motion is an angle of the table in rad (a position in m on a linear axis); times are in s.
Build one with the functions beside this class; add signals with +, scale them with *.)");
    python::pickles(bound, python::waveform_of);
    bound
        .def(
            "__init__",
            [](Waveform* self, const nb::object& knots, const nb::object& pieces) {
                new (self) Waveform(list(knots, "knots"), polynomials(pieces));
            },
            "knots"_a, "pieces"_a, R"(Polynomial pieces.

knots: shape (n,), increasing, s. pieces: shape (n + 1, degree + 1), degree at most 5: row 0 before the first
knot, row k from knot k - 1 to knot k, the last row from the last knot on; coefficients of rising powers of the
time since the piece's own first knot (row 0: since the first knot).
Raises ValueError naming index, value and rule.)",
            nb::sig("def __init__(self, knots: numpy.typing.ArrayLike, pieces: numpy.typing.ArrayLike) -> None"))
        .def(
            "value",
            [](const Waveform& w, const nb::object& t) { return over(t, [&w](double s) { return w.value(s); }); },
            "times"_a, R"(The signal at times in s: a float for a float, else an array of the same shape.

At a breakpoint the value is that of the side which follows it.)",
            nb::sig("def value(self, times: numpy.typing.ArrayLike) -> typing.Any"))
        .def(
            "rate",
            [](const Waveform& w, const nb::object& t) { return over(t, [&w](double s) { return w.rate(s); }); },
            "times"_a, "Its first derivative, per s; shapes as for value().",
            nb::sig("def rate(self, times: numpy.typing.ArrayLike) -> typing.Any"))
        .def(
            "acceleration",
            [](const Waveform& w, const nb::object& t) {
                return over(t, [&w](double s) { return w.acceleration(s); });
            },
            "times"_a, "Its second derivative, per s^2; shapes as for value().",
            nb::sig("def acceleration(self, times: numpy.typing.ArrayLike) -> typing.Any"))
        .def(
            "breaks", [](const Waveform& w) { return array_of(w.breaks()); },
            "Times in s, increasing, where value, rate or acceleration jumps; shape (n,).",
            nb::sig("def breaks(self) -> numpy.typing.NDArray[numpy.float64]"))
        .def(
            "knots", [](const Waveform& w) { return array_of(w.knots()); },
            "Times in s, increasing, where the formula changes, smoothly or not; shape (n,).",
            nb::sig("def knots(self) -> numpy.typing.NDArray[numpy.float64]"))
        .def("end", &Waveform::end,
             "The time in s from which the signal rests; infinite if it never does, 0 for a constant.")
        .def(nb::self + nb::self, nb::is_operator())
        .def("__mul__", &Waveform::scaled, "factor"_a, nb::is_operator())
        .def("__rmul__", &Waveform::scaled, "factor"_a, nb::is_operator());
}

void bind_simple_signals(nb::module_& m) {
    m.def("constant", &motion::constant, "value"_a, "The same value at all times.");
    m.def("step", &motion::step, "height"_a, "at"_a = 0.0, "Zero before `at` (s), `height` from there on.");
    m.def("ramp", &motion::ramp, "rate"_a, "start"_a = 0.0, "end"_a = infinite,
          "Zero before `start` (s), rising by `rate` per s until `end`, then held. Raises ValueError unless end > "
          "start.");
    m.def("sine", &motion::sine, "amplitude"_a, "frequency_hz"_a, "phase"_a = 0.0, "offset"_a = 0.0, "start"_a = 0.0,
          R"(offset + amplitude sin(2 pi f (t - start) + phase) from `start` (s) on, before it the offset alone.

phase in rad. Raises ValueError unless frequency_hz > 0 and all numbers are finite.)");
    m.def("sum", &motion::sum, "waveforms"_a, "The sum of a list of signals; of none: zero.");
    m.def("scale", &motion::scale, "waveform"_a, "factor"_a, "The signal times a number.");
    m.def("shift", &motion::shift, "waveform"_a, "delay"_a, "The same signal, later by `delay` s.");
}

void bind_multisines(nb::module_& m) {
    m.def(
        "multisine",
        [](const nb::object& amplitudes, const nb::object& frequencies, const nb::object& phases, double start) {
            return motion::multisine(list(amplitudes, "amplitudes"), list(frequencies, "frequencies_hz"),
                                     list(phases, "phases"), start);
        },
        "amplitudes"_a, "frequencies_hz"_a, "phases"_a, "start"_a = 0.0,
        R"(Sum of amplitudes[k] sin(2 pi frequencies_hz[k] (t - start) + phases[k]) from `start` (s) on, zero before.

Three lists of one length >= 1, phases in rad. Raises ValueError naming argument, value and rule.)",
        nb::sig("def multisine(amplitudes: numpy.typing.ArrayLike, frequencies_hz: numpy.typing.ArrayLike, "
                "phases: numpy.typing.ArrayLike, start: float = 0.0) -> Waveform"));
    nb::enum_<motion::Phases>(m, "Phases", "How the lines of a multisine stand to each other.")
        .value("random", motion::Phases::random, "uniform, from the seed; the same on every computer")
        .value("schroeder", motion::Phases::schroeder, "a low peak for the same RMS value");
    m.def("odd_multisine", &motion::odd_multisine, "rms"_a, "base_frequency_hz"_a, "lines"_a, "seed"_a = 0,
          "phases"_a = motion::Phases::random, "start"_a = 0.0, "from_zero"_a = false,
          R"(A flat multisine on `lines` odd harmonics f, 3f, 5f, ... of the base frequency, with the given RMS value.

What a machine answers at even harmonics is then its even nonlinearity. The signal begins with its own value at
`start` (s); from_zero subtracts that value, so that a commanded position does not jump.
Raises ValueError unless rms, base_frequency_hz and lines are positive.)");
}

void bind_moves(nb::module_& m) {
    m.def("jerk_limited_move", &motion::jerk_limited_move, "distance"_a, "speed"_a, "acceleration"_a, "jerk"_a,
          "start"_a = 0.0, "from_"_a = 0.0,
          R"(The fastest move from rest at `from_` to rest at `from_ + distance`, beginning at `start` (s).

distance in rad at the table (or m), of either sign; limits speed, acceleration and jerk positive, in rad/s,
rad/s^2, rad/s^3; jerk = inf gives a trapezoid of speed. Short moves reach less than the limits.
Raises ValueError naming argument, value and rule. Source: Biagiotti & Melchiorri 2008, section 3.4.)");
    m.def(
        "cycle_of_moves",
        [](const nb::object& targets, double speed, double acceleration, double jerk, double dwell, double start,
           int repeats, double from) {
            return motion::cycle_of_moves(list(targets, "targets"), speed, acceleration, jerk, dwell, start, repeats,
                                          from);
        },
        "targets"_a, "speed"_a, "acceleration"_a, "jerk"_a, "dwell"_a = 0.0, "start"_a = 0.0, "repeats"_a = 1,
        "from_"_a = 0.0, R"(Moves from `from_` to each target in turn, a dwell (s) after each, all `repeats` times.

targets: shape (n,), rad at the table (or m); limits as for jerk_limited_move. Ends with the last dwell.
Raises ValueError naming argument, value and rule.)",
        nb::sig("def cycle_of_moves(targets: numpy.typing.ArrayLike, speed: float, acceleration: float, jerk: float, "
                "dwell: float = 0.0, start: float = 0.0, repeats: int = 1, from_: float = 0.0) -> Waveform"));
    m.def(
        "dwells_of_cycle",
        [](const nb::object& targets, double speed, double acceleration, double jerk, double dwell, double start,
           int repeats, double from) {
            std::vector<double> rows;
            for (const motion::Dwell& d : motion::dwells_of_cycle(list(targets, "targets"), speed, acceleration, jerk,
                                                                  dwell, start, repeats, from))
                rows.insert(rows.end(), {d.target, d.begin, d.end});
            const std::size_t count = rows.size() / 3;
            return array_of(std::move(rows), {count, 3});
        },
        "targets"_a, "speed"_a, "acceleration"_a, "jerk"_a, "dwell"_a = 0.0, "start"_a = 0.0, "repeats"_a = 1,
        "from_"_a = 0.0, R"(When that cycle stands at its targets: shape (moves, 3), columns target, begin (s), end (s).

Arguments and errors as for cycle_of_moves.)",
        nb::sig("def dwells_of_cycle(targets: numpy.typing.ArrayLike, speed: float, acceleration: float, jerk: float, "
                "dwell: float = 0.0, start: float = 0.0, repeats: int = 1, from_: float = 0.0) "
                "-> numpy.typing.NDArray[numpy.float64]"));
    m.def(
        "bidirectional_targets",
        [](const nb::object& positions, double overrun) {
            return array_of(motion::bidirectional_targets(list(positions, "positions"), overrun));
        },
        "positions"_a, "overrun"_a, R"(Targets of one bidirectional cycle after ISO 230-2, for cycle_of_moves.

Below the first position by `overrun` > 0, up through all, beyond the last by `overrun`, down through all.
positions: shape (n,), n >= 2, increasing; the result has shape (2 n + 2,). Raises ValueError.)",
        nb::sig("def bidirectional_targets(positions: numpy.typing.ArrayLike, overrun: float) "
                "-> numpy.typing.NDArray[numpy.float64]"));
}

void bind_recordings(nb::module_& m) {
    nb::enum_<motion::Interpolation>(m, "Interpolation", "What a recorded signal does between its samples.")
        .value("hold", motion::Interpolation::hold, "the last sample's value")
        .value("linear", motion::Interpolation::linear, "straight lines")
        .value("cubic", motion::Interpolation::cubic, "a not-a-knot spline with continuous acceleration");
    m.def(
        "sampled",
        [](const nb::object& times, const nb::object& values, motion::Interpolation interpolation) {
            return motion::sampled(list(times, "times"), list(values, "values"), interpolation);
        },
        "times"_a, "values"_a, "interpolation"_a = motion::Interpolation::cubic,
        R"(A recorded signal through `values` at increasing `times` (s), even or not; shapes (n,), n >= 2 (hold: 1).

Before the first and after the last sample the end values are held. Each change of value (hold) or of slope
(linear) is a break, where a solver stops; cubic has none but its ends, and overshoots at steps.
Raises ValueError naming argument, index, value and rule.)",
        nb::sig("def sampled(times: numpy.typing.ArrayLike, values: numpy.typing.ArrayLike, "
                "interpolation: Interpolation = ...) -> Waveform"));
}

}  // namespace

void bind_waveform(nb::module_& m) {
    bind_class(m);
    bind_simple_signals(m);
    bind_multisines(m);
    bind_moves(m);
    bind_recordings(m);
}

}  // namespace dualdrive
