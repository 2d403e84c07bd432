"""Slopes about the machine without what is not affine of it, where a search may begin with them."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library
from dualdrive.innovations import (
    GreyBox,
    Point,
    Variant,
    coordinates,
    first_noise,
    fit,
    slopes,
)
from dualdrive.innovations.derivatives import slopes_nearby
from test_innovations import bench

SAMPLES = 4000
#: law -> its numbers in the machine that is recorded
LAWS = {
    "eccentricity@table": {"amplitude": 1e-3, "phase": 0.5},
    "encoder_eccentricity@table": {"amplitude": 1e-4, "phase": 1.0},
    "stribeck@table": {"torque": 0.3, "static_ratio": 1.5, "speed": 0.05},
    "coulomb@table": {"torque": 0.4},
}

Array = NDArray[np.float64]


@functools.cache
def variant_of(law: str) -> tuple[GreyBox, Variant, Array]:
    """The bench on a record of one with a law; the law to be fitted, its order known; the truth."""
    recorded = bench({law: LAWS[law]})
    own = grey_box(Machine.load("bench"), recorded, SAMPLES, 3)
    nothing = Variant(own.core)
    blank = tuple(np.zeros_like(r.measured) for r in own.records)
    base = Point(nothing, own.start(nothing), blank, 0.0, 0.0)
    known = [v for v in Library(own.core, own).variants(nothing, base) if v.label == law]
    variant = next(v for v in known if all(recorded.get(p) == x for p, x in v.fixed.items()))
    true = {p.path: recorded.get(p.path) for p in variant.extra}
    return own, variant, np.r_[own.start(nothing), coordinates(variant.extra, true)]


@pytest.mark.parametrize("law", LAWS)
def test_under_unknown_torque_they_are_near_those_at_the_point(law: str) -> None:
    own, variant, true = variant_of(law)
    gains = own.gains(variant, true, first_noise(own.core, own.records, 0.1))
    [point] = own.points([variant], [true], gains)
    exact = slopes(own, point, range(len(true)), gains)
    found, at_the_point = slopes_nearby(own, point, gains)
    assert at_the_point == (law == "coulomb@table"), "what is affine is told at the point itself"
    apart = [
        float(np.linalg.norm(a - b) / np.linalg.norm(a)) for a, b in zip(exact, found, strict=True)
    ]
    assert np.median(apart[: own.shared]) < 0.15


@pytest.mark.parametrize("law", LAWS)
def test_a_fit_with_them_comes_as_near(law: str) -> None:
    own, variant, true = variant_of(law)
    wide = first_noise(own.core, own.records, 0.1)
    start = true.copy()
    start[[k for k, p in enumerate(variant.extra, own.shared) if p.strength]] *= 0.7
    gains = own.gains(variant, start, wide)
    [begun] = own.points([variant], [start], gains)
    exact, found = (fit(own, variant, start, gains, nearby=near) for near in (False, True))
    assert begun.chi2 - exact.chi2 > 100.0
    assert begun.chi2 - found.chi2 > 0.7 * (begun.chi2 - exact.chi2)


def test_differences_remember_nothing() -> None:
    own, variant, true = variant_of("stribeck@table")
    gains = own.gains(variant, true, first_noise(own.core, own.records, 1e-3))
    [point, elsewhere] = own.points([variant] * 2, [true, own.start(variant)], gains)
    first = slopes(own, point, range(len(true)), gains)
    slopes(own, elsewhere, range(len(true)), gains)
    again = slopes(own, point, range(len(true)), gains)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
