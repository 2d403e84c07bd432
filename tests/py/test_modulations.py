"""An inertia that changes with the angle is fitted by what it is at the usual angle."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench_record import grey_box
from dualdrive import Machine, motion
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.innovations import (
    GreyBox,
    Point,
    Variant,
    covariance,
    first_noise,
    flat,
    inflation,
    slopes,
)
from dualdrive.innovations.modulations import usual_angle
from test_innovations import STEP, bench

Array = NDArray[np.float64]

LAW = "position_dependent_inertia@table"
SIZE, PHASE = 0.15, 2.8
SAMPLES = 4000
TURN = 0.5  # rad


def way() -> Any:
    """Two seconds to and fro about one angle, then two of half a radian; rad at the table."""
    t = STEP * np.arange(SAMPLES)
    rock = 0.02 * np.sin(2.0 * np.pi * 4.0 * t) * (t < 2.0)
    s = np.clip((t - 2.0) / 2.0, 0.0, 1.0)
    return motion.sampled(t, rock + TURN * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)).waveform


@pytest.fixture(scope="module")
def seen() -> tuple[GreyBox, Variant]:
    """The record of a bench whose table is like that, and the law that says so."""
    true = bench({LAW: {"amplitude": SIZE, "order": 1.0, "phase": PHASE}})
    grey = grey_box(Machine.load("bench"), true, SAMPLES, 5, motion=way())
    nothing = Variant(grey.core)
    blank = tuple(np.zeros_like(r.measured) for r in grey.records)
    point = Point(nothing, grey.start(nothing), blank, 0.0, 0.0)
    known = Library(grey.core, grey).variants(nothing, point)
    return grey, next(v for v in known if v.key == f"{LAW} (order 1)")


def told(grey: GreyBox, law: Variant, inertia: float, amplitude: float, phase: float) -> Point:
    """The law at these numbers, all others as the data sheet has them."""
    start = grey.of_the_data_sheet(law)
    at = grey.values(law, start) | {
        "table.J": inertia, f"{LAW}.amplitude": amplitude, f"{LAW}.phase": phase,
    }  # fmt: skip
    constants = np.zeros(len(grey.offsets))
    return Point(law, grey.point_of(law, at, constants), (), 0.0, 0.0)


def test_values_come_back(seen: tuple[GreyBox, Variant]) -> None:
    grey, law = seen
    there = told(grey, law, 0.23, 0.3, -2.0)
    at = grey.values(law, there.theta)
    assert at["table.J"] == pytest.approx(0.23)
    assert at[f"{LAW}.amplitude"] == pytest.approx(0.3)
    assert at[f"{LAW}.phase"] == pytest.approx(-2.0)
    machine = grey.machine(law, there.theta)
    assert machine.get("table.J") == pytest.approx(0.23)
    assert machine.get(f"{LAW}.amplitude") == pytest.approx(0.3)


def test_where_records_accelerate_nothing_changes_with_the_wave(
    seen: tuple[GreyBox, Variant],
) -> None:
    grey, law = seen
    about = [r.record.reference for r in grey.records]
    angle = usual_angle(about, [STEP])
    assert abs(angle) < 0.02
    theta, there = told(grey, law, 0.23, 0.0, 0.0).theta, []
    for x, y in ((0.0, 0.0), (1.0, 0.0), (0.5, -1.5)):
        moved = theta.copy()
        moved[grey.shared :] = x, y
        at = grey.values(law, moved)
        turned = math.cos(angle + at[f"{LAW}.phase"])
        there.append(at["table.J"] * (1.0 + at[f"{LAW}.amplitude"] * turned))
    assert there == pytest.approx([0.23] * 3, rel=1e-12)


def test_a_record_at_rest_has_a_usual_angle_too() -> None:
    assert usual_angle([np.full(5, 0.3)], [STEP]) == pytest.approx(0.3)


def test_a_wave_beyond_what_it_may_be_is_no_machine(seen: tuple[GreyBox, Variant]) -> None:
    grey, law = seen
    theta = told(grey, law, 0.23, 0.0, 0.0).theta
    theta[grey.shared] = (
        0.89 / law.extra[0].scale
    )  # of what is there 0.89: more than is left as mean
    with pytest.raises(ValueError, match="amplitude"):
        grey.machine(law, theta)
    gains = grey.gains(law, grey.start(law), first_noise(grey.core, grey.records, 1e-4))
    [there] = grey.points([law], [theta], gains)
    assert there.lost


def relative(grey: GreyBox, law: Variant, theta: Array) -> dict[str, float]:
    """Numbers of the machine, cosine and sine of the swing in place of amplitude and phase."""
    at = grey.values(law, theta)
    swing = cmath.rect(at[f"{LAW}.amplitude"], at[f"{LAW}.phase"])
    return at | {f"{LAW}.amplitude": swing.real, f"{LAW}.phase": swing.imag}


class Valley:
    """About the truth, held gains: the likelihood's parabola, and steps of its standard errors."""

    def __init__(self, seen: tuple[GreyBox, Variant]) -> None:
        grey, law = self.grey, self.law = seen
        theta = told(grey, law, grey.core.get("table.J"), SIZE, PHASE).theta
        [found] = grey.likelihoods(law, [(theta, first_noise(grey.core, grey.records, 1e-4))])
        assert found is not None
        self.point, self.gains = found
        columns = np.stack(slopes(grey, self.point, range(len(theta)), self.gains))
        centre, precision = grey.believed(law)
        self.information = columns @ columns.T + np.diag(precision)
        self.gradient = columns @ flat(self.point.residuals) + precision * (theta - centre)

    def step(self, wave: int, times: float) -> Array:
        """So many standard errors along what is told least of the wave's cosine, or sine."""
        spread, k = covariance(self.information), self.grey.shared + wave
        found: Array = times * spread[:, k] / math.sqrt(spread[k, k])
        return found

    def beside_the_parabola(self, step: Array, there: Array) -> float:
        """By how much -2 log L at a point is off what a step would make of it."""
        [other] = self.grey.points([self.law], [there], self.gains)
        parabola = 2.0 * self.gradient @ step + step @ self.information @ step
        return float(other.minus_two_log - self.point.minus_two_log - parabola)


@pytest.mark.parametrize("wave", [0, 1])
@pytest.mark.parametrize("times", [-3.0, 3.0])
def test_along_its_valley_the_likelihood_is_a_parabola(
    seen: tuple[GreyBox, Variant], wave: int, times: float
) -> None:
    own = Valley(seen)
    step = own.step(wave, times)
    assert abs(own.beside_the_parabola(step, own.point.theta + step)) < 3.0


@pytest.mark.parametrize("times", [-3.0, 3.0])
def test_in_mean_and_swing_its_valley_is_bent(seen: tuple[GreyBox, Variant], times: float) -> None:
    """As far straight on in the mean, and in the swing's cosine and sine as fractions of it."""
    own = Valley(seen)
    step, theta = own.step(0, times), own.point.theta
    grey, law, part = own.grey, own.law, 1e-4
    begun, little = (relative(grey, law, x) for x in (theta, theta + part * step))
    straight = {path: x + (little[path] - x) / part for path, x in begun.items()}
    swing = complex(straight[f"{LAW}.amplitude"], straight[f"{LAW}.phase"])
    straight |= {f"{LAW}.amplitude": abs(swing), f"{LAW}.phase": cmath.phase(swing)}
    constants = (theta + step)[len(grey.nominal) : grey.shared]
    there = grey.point_of(law, straight, constants)
    assert own.beside_the_parabola(step, there) > 10_000.0


def test_intervals_are_those_of_mean_and_amplitude(seen: tuple[GreyBox, Variant]) -> None:
    """Against a cloud of points, a tenth as wide: they are those of the first order."""
    grey, law = seen
    theta = told(grey, law, grey.core.get("table.J"), SIZE, PHASE).theta
    noise = first_noise(grey.core, grey.records, 1e-4)
    [found] = grey.likelihoods(law, [(theta, noise)])
    assert found is not None
    point, gains = found
    f = Fitted(point, noise, inflation(point), 0.0, gains)
    sure = Uncertainty(grey)
    columns = np.stack(slopes(grey, point, range(len(theta)), gains))
    precision = np.diag(grey.believed(law)[1])
    spread = covariance(columns @ columns.T / inflation(point) + precision)
    cloud = np.random.default_rng(2).multivariate_normal(theta, 0.01 * spread, 4000)
    values = [grey.values(law, x) for x in cloud]
    known = sure.intervals(f)
    for path in ("table.J", f"{LAW}.amplitude"):
        half = 0.5 * (known[path].high - known[path].low)
        assert half == pytest.approx(19.6 * np.std([v[path] for v in values]), rel=0.1), path
