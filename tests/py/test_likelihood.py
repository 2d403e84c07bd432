"""Numbers and noise of a grey box, estimated from records whose truth is known.

The bench is simulated by the exact engine; a recursion of its own makes the sensors' noise.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library, Scored, scores
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.refits import refining
from dualdrive.diagnose.shape import of_the_filter, shapes
from dualdrive.innovations import (
    GreyBox,
    Noise,
    Point,
    Variant,
    first_noise,
    fit,
    inflation,
    least_noise,
    maximum_likelihood,
    score_of_order_two,
    simulated,
    slopes,
    values,
)
from test_innovations import SENSORS, bench

SAMPLES = 4000
#: of the motors' encoders, the table's, the currents: drive and memory of SENSORS
TRUTH = {"table angle": SENSORS[0], "drive angle": SENSORS[1], "drive current": SENSORS[3]}
HEAVIER, FRICTION = 1.06, 0.4
FIRST, SECOND = 0.5, -0.6  # partial autocorrelations

Array = NDArray[np.float64]


@functools.cache
def grey(friction: float, seed: int = 3) -> GreyBox:
    """The data sheet's bench on a record of one whose table is 6 % heavier."""
    true = bench({"coulomb@table": {"torque": friction}} if friction else {})
    true.set("table.J", HEAVIER * true.get("table.J"))
    return grey_box(Machine.load("bench"), true, SAMPLES, seed)


def with_law(own: GreyBox, law: str) -> Variant:
    """The data sheet's machine with a law of the library."""
    nothing = Variant(own.core)
    blank = tuple(np.zeros_like(r.measured) for r in own.records)
    base = Point(nothing, own.start(nothing), blank, 0.0, 0.0)
    return next(v for v in Library(own.core, own).variants(nothing, base) if v.label == law)


@functools.cache
def likeliest(friction: float, law: str = "nothing") -> tuple[Point, Noise, list[Any]]:
    own = grey(friction)
    variant = with_law(own, law) if law != "nothing" else Variant(own.core)
    wide = first_noise(own.core, own.records, 0.1)
    floor = least_noise(own.core, own.records, 1e-5)
    start = own.start(variant)
    found = maximum_likelihood(own, variant, start, wide, floor=floor, steps=30, guessed=True)
    assert found is not None
    return found


def test_sensors_and_numbers_are_recovered_together() -> None:
    point, noise, gains = likeliest(0.0)
    for kind, (drive, memory, _) in TRUTH.items():
        assert noise.drive[kind] == pytest.approx(drive, rel=0.05), kind
        assert noise.memory[kind] == pytest.approx(memory, abs=0.06), kind
    assert point.chi2 / point.residuals[0].size == pytest.approx(1.0, abs=0.03)
    assert inflation(point) < 1.5
    own = grey(0.0)
    k = [p.path for p in own.nominal].index("table.J")
    J = np.stack(slopes(own, point, range(len(point.theta)), gains))
    H = J @ J.T + np.diag(1.0 / own.sigma**2)
    error = float(np.sqrt(np.linalg.inv(H)[k, k]))
    off = point.theta[k] - own.nominal[k].coordinate(HEAVIER * own.core.get("table.J"))
    assert abs(off) < 3.5 * error
    assert error < 0.005, "the record tells inertia to half a per cent"


@pytest.mark.parametrize("off", [1e-4, 1e12])  # nothing moves so slowly, or so fast
def test_a_stribeck_speed_that_records_tell_nothing_of_is_led_back(off: float) -> None:
    true = {"torque": FRICTION, "static_ratio": 1.4, "speed": 0.02}
    own = grey_box(Machine.load("bench"), bench({"stribeck@table": true}), SAMPLES, 3)
    variant, noise = with_law(own, "stribeck@table"), first_noise(own.core, own.records, 0.01)
    begin = own.start(variant)
    known = {"torque": FRICTION, "speed": off * true["speed"]}
    for k, p in enumerate(variant.extra, own.shared):
        begin[k] = p.coordinate(known.get(p.path.rpartition(".")[2], p.nominal))
    found = fit(own, variant, begin, own.gains(variant, begin, noise), steps=15)
    sizes = values(variant.extra, found.theta[own.shared :])
    assert sizes["stribeck@table.speed"] == pytest.approx(true["speed"], rel=0.1)
    assert sizes["stribeck@table.static_ratio"] == pytest.approx(true["static_ratio"], rel=0.05)


@pytest.mark.long
def test_a_missing_law_is_borne_by_the_unknown_torque_and_not_by_the_sensors() -> None:
    _, without, _ = likeliest(FRICTION)
    _, with_it, _ = likeliest(FRICTION, "coulomb@table")
    for kind, (drive, _, _) in TRUTH.items():
        assert without.drive[kind] == pytest.approx(drive, rel=0.15), kind
    assert without.torque["table"] > 10.0 * with_it.torque["table"]


def test_the_torque_that_bears_it_is_a_curve_along_the_speed() -> None:
    own = grey(FRICTION)
    point, _, gains = likeliest(FRICTION)
    best, *_ = shapes(of_the_filter(own, point, gains))
    assert (best.equation, best.coordinate, best.unit) == ("table", "direction", "N*m")
    assert best.explained > 0.5
    backward, forward = best.value
    share = (backward - forward) / (2.0 * FRICTION)
    assert 0.6 < share < 1.0, "less by what the filter takes to learn of a reversal"


def test_the_law_that_is_missing_is_likelier_and_has_its_size() -> None:
    nothing, _, _ = likeliest(FRICTION)
    law, _, _ = likeliest(FRICTION, "coulomb@table")
    assert law.minus_two_log < nothing.minus_two_log - 1000.0
    [torque, *_] = law.variant.extra
    found = torque.value(float(law.theta[grey(FRICTION).shared]))
    assert found == pytest.approx(FRICTION, rel=0.02)


def test_a_part_that_refines_a_law_begins_at_its_numbers() -> None:
    own = grey(FRICTION)
    point, noise, gains = likeliest(FRICTION, "coulomb@table")
    known = Fitted(point, noise, inflation(point), 0.0, gains)
    nothing = likeliest(FRICTION)[0]
    beside = Library(own.core, own).variants(nothing.variant, nothing)
    bristles, limit = (
        next(v for v in beside if v.label == label)
        for label in ("lugre@table", "current_limit@motors")
    )
    begun = own.machine(bristles, refining(own, known, Scored(bristles, 5.0, {})))
    level = own.machine(point.variant, point.theta).get("coulomb@table.torque")
    assert begun.get("lugre@table.torque") == pytest.approx(level, rel=1e-9)
    assert begun.get("table.J") == pytest.approx(HEAVIER * own.core.get("table.J"), rel=0.01)
    alone = own.machine(limit, refining(own, known, Scored(limit, 5.0, {})))
    start = own.machine(limit, own.start(limit))
    assert alone.get("current_limit@motors.T_max") == start.get("current_limit@motors.T_max")


def test_the_score_points_at_the_law() -> None:
    own = grey(FRICTION)
    point, _, gains = likeliest(FRICTION)
    known = Library(own.core, own).variants(point.variant, point)
    wanted = ("coulomb@table", "viscous@table", "unbalance@table")
    few = [v for v in known if v.label in wanted]
    columns = slopes(own, point, range(len(point.theta)), gains)
    found = {s.variant.label: s for s in scores(own, point, columns, few, gains, 1.0)}
    best = max(found.values(), key=lambda s: s.gain)
    assert best.variant.label == "coulomb@table"
    assert 0.0 < best.start["coulomb@table.torque"] < 2.0 * FRICTION


@pytest.mark.parametrize("late", [2e-4, -2e-4])
def test_a_delay_that_would_have_to_be_negative_gains_nothing(late: float) -> None:
    true = bench({})
    own = grey_box(Machine.load("bench"), true, SAMPLES, 3, late={"theta_1": late})
    start, wide = own.start(Variant(own.core)), first_noise(own.core, own.records, 0.01)
    quiet = replace(
        wide,
        drive={kind: drive for kind, (drive, _, _) in TRUTH.items()},
        memory={kind: memory for kind, (_, memory, _) in TRUTH.items()},
    )
    [found] = own.likelihoods(Variant(own.core), [(start, quiet)])
    assert found is not None
    point, gains = found
    known = Library(own.core, own).variants(point.variant, point)
    [delay] = [v for v in known if v.label == "sensor_delay@theta_1"]
    columns = slopes(own, point, range(len(start)), gains)
    [score] = scores(own, point, columns, [delay], gains, 1.0)
    assert (score.gain > 25.0) if late > 0.0 else (abs(score.gain) < 1e-6)


@pytest.mark.parametrize("late", [3e-4, 5e-4, 7e-4, 1.4e-3, 2.5e-3])
def test_a_reading_of_any_part_of_a_sample_ago_is_followed(late: float) -> None:
    """Under gains that hardly trust the model, corrections by late readings may swing up."""
    own = grey_box(Machine.load("bench"), bench({}), SAMPLES, 3, late={"theta_1": late})
    blank = tuple(np.zeros_like(r.measured) for r in own.records)
    nothing = Variant(own.core)
    known = Library(own.core, own).variants(
        nothing, Point(nothing, own.start(nothing), blank, 0.0, 0.0)
    )
    [delay] = [v for v in known if v.label == "sensor_delay@theta_1"]
    [time] = delay.extra
    for share in (0.1, 1e-3):
        noise = first_noise(own.core, own.records, share)
        thetas = [np.r_[own.start(nothing), time.coordinate(x)] for x in (late, 0.0, 2.0 * late)]
        found = own.likelihoods(delay, [(theta, noise) for theta in thetas])
        heights = [f[0].minus_two_log if f else np.inf for f in found]
        if share == 0.1:
            assert max(heights) < min(heights) + 1000.0  # none is lost
        else:
            assert heights[0] < min(heights[1:]) - 100.0


def order_two(random: np.random.Generator, samples: int, second: float = SECOND) -> Array:
    """The same drives, through a resonance at a sixth of the sampling rate."""
    w = random.normal(size=(samples + 500, len(SENSORS))) * [drive for drive, *_ in SENSORS]
    return np.asarray(lfilter([1.0], [1.0, -FIRST * (1.0 - second), -second], w, axis=0)[500:])


def test_noise_of_order_two_is_recovered() -> None:
    own = grey_box(Machine.load("bench"), bench({}), SAMPLES, 5, noise=order_two)
    nothing = Variant(own.core)
    wide = first_noise(own.core, own.records, 0.1)
    floor = least_noise(own.core, own.records, 1e-5)
    one = maximum_likelihood(own, nothing, own.start(nothing), wide, floor=floor, guessed=True)
    assert one is not None
    two = maximum_likelihood(own, nothing, one[0].theta, one[1].of_order_two(), floor=floor)
    assert two is not None
    point, noise, _ = two
    assert point.minus_two_log < one[0].minus_two_log - 1000.0
    for kind in TRUTH:
        assert noise.memory[kind] == pytest.approx(FIRST, abs=0.05), kind
        assert noise.second[kind] == pytest.approx(SECOND, abs=0.05), kind


@pytest.mark.parametrize("second", [-0.06, -0.12])
def test_the_score_of_a_little_noise_of_order_two_is_what_it_gains(second: float) -> None:
    noise = functools.partial(order_two, second=second)
    own = grey_box(Machine.load("bench"), bench({}), SAMPLES, 5, noise=noise)
    nothing, floor = Variant(own.core), least_noise(own.core, own.records, 1e-5)
    wide = first_noise(own.core, own.records, 0.1)
    one = maximum_likelihood(own, nothing, own.start(nothing), wide, floor=floor, guessed=True)
    assert one is not None
    score = score_of_order_two(own, nothing, one[0].theta, one[1], floor)
    two = maximum_likelihood(own, nothing, one[0].theta, one[1].of_order_two(), floor=floor)
    assert two is not None
    assert score == pytest.approx(one[0].minus_two_log - two[0].minus_two_log, rel=0.05)


@pytest.mark.parametrize("seed", [5, 6, 7, 8])
def test_the_score_of_noise_that_is_not_there_is_chi_squared(seed: int) -> None:
    own = grey_box(Machine.load("bench"), bench({}), SAMPLES, seed)
    nothing, floor = Variant(own.core), least_noise(own.core, own.records, 1e-5)
    wide = first_noise(own.core, own.records, 0.1)
    one = maximum_likelihood(own, nothing, own.start(nothing), wide, floor=floor, guessed=True)
    assert one is not None
    score = score_of_order_two(own, nothing, one[0].theta, one[1], floor)
    assert score < chi2.isf(1e-3, len(TRUTH))


def test_what_drives_nothing_is_no_hindrance_to_the_score() -> None:
    """As creep of a body that never rests, of which records tell nothing: a row of zeros."""
    own = grey_box(Machine.load("bench"), bench({}), SAMPLES, 5)
    nothing, wide = Variant(own.core), first_noise(own.core, own.records, 0.1)
    none = replace(wide, torque=dict.fromkeys(wide.torque, 0.0))
    one = maximum_likelihood(own, nothing, own.start(nothing), none, guessed=True)
    assert one is not None
    score = score_of_order_two(own, nothing, one[0].theta, one[1])
    assert score < chi2.isf(1e-3, len(TRUTH))


def test_a_record_simulated_whole_leaves_its_sensors_noise() -> None:
    point, _, _ = likeliest(0.0)
    missed = simulated(grey(0.0), point.variant, point.theta)
    assert missed is not None
    for column, (drive, memory, _) in zip(missed.missed[0].T, SENSORS, strict=True):
        assert np.std(column) == pytest.approx(drive / np.sqrt(1.0 - memory**2), rel=0.2)
