"""Dry friction that lets what it holds creep, as that of other programs and of greased guides does.

The true machine's friction is a formula, c·tanh(ω/w), which the library knows under no name; what
is found is dry friction, and that what it holds goes on at a speed of unknown course.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine, _core
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.innovations import (
    GreyBox,
    Noise,
    Point,
    Variant,
    inflation,
)
from dualdrive.replay import core_of
from test_innovations import SENSORS, bench, coloured, record, run

SAMPLES, FRICTION = 6000, 0.5
SLOW = _core.sine(0.02, 0.25)  # the table is held for a while where it turns round
ADVANCED = 2e-4  # rad/s: over which the friction of the true machine sets in
#: an inflation that white innovations may have: three deviations of sums over 50 samples each
WHITE = 1.0 + 3.0 * np.sqrt(2.0 * 50 / (SAMPLES * len(SENSORS)))


def true_machine(sharp: bool) -> Any:
    true = Machine.load("bench")
    if sharp:
        true.add("coulomb", "table", torque=FRICTION)
    else:
        numbers = {
            "c": {"value": FRICTION, "unit": "N*m"},
            "w": {"value": ADVANCED, "unit": "rad/s"},
        }
        true.add("expression", "table", formula="-c*tanh(speed/w)", parameters=numbers)
    return core_of(true)


@functools.cache
def likeliest(sharp: bool) -> tuple[GreyBox, Point, Noise]:
    own = grey_box(Machine.load("bench"), true_machine(sharp), SAMPLES, 3, motion=SLOW)
    nothing = Variant(own.core)
    blank = tuple(np.zeros_like(r.measured) for r in own.records)
    known = Library(own.core, own).variants(
        nothing, Point(nothing, own.start(nothing), blank, 0.0, 0.0)
    )
    law = next(v for v in known if v.label == "coulomb@table")
    estimator = Estimator(own.core, own)
    near = estimator.from_far(own, law, own.start(law))
    assert near is not None
    found = estimator.likeliest(own, law, near.point.theta, near.noise)
    assert found is not None
    return own, found.point, found.noise


def level(own: GreyBox, point: Point) -> float:
    return float(own.machine(point.variant, point.theta).get("coulomb@table.torque"))


def likelihood(own: GreyBox, point: Point, noise: Noise) -> tuple[float, float]:
    """-2 log L of the same numbers under another noise, and its inflation."""
    [found] = own.likelihoods(point.variant, [(point.theta, noise)])
    assert found is not None
    return found[0].minus_two_log, inflation(found[0])


def test_friction_that_sets_in_over_a_speed_is_dry_friction_that_creeps() -> None:
    own, point, noise = likeliest(sharp=False)
    assert level(own, point) == pytest.approx(FRICTION, rel=0.01)
    assert inflation(point) < WHITE
    held, left = likelihood(own, point, replace(noise, creep={}))
    assert held > point.minus_two_log + 500.0
    assert left > 2.0, "as long as nothing that is held may move"


def test_what_is_dry_does_not_creep() -> None:
    own, point, noise = likeliest(sharp=True)
    assert level(own, point) == pytest.approx(FRICTION, rel=1e-3)
    assert noise.creep["table"] / np.sqrt(1.0 - noise.course**2) < 1e-3 * ADVANCED
    held, _ = likelihood(own, point, replace(noise, creep={}))
    assert held == pytest.approx(point.minus_two_log, abs=1.0)


@pytest.mark.parametrize("law", ["coulomb@table", "stribeck@table"])
def test_a_filter_follows_what_creeps_whether_a_law_is_affine_or_not(law: str) -> None:
    motion = {"theta_ref": SLOW}
    noise = coloured(np.random.default_rng(4), SAMPLES)
    seen = record(motion, run(true_machine(sharp=False), motion, SAMPLES) + noise)
    core = bench({law: {"torque": FRICTION}})
    if law.startswith("stribeck"):
        core.set(f"{law}.static_ratio", 1.0)
    found = []
    for creep in ({}, {"table": (3e-5, 0.99)}):
        gains = _core.kalman_gains(core, seen, SENSORS, {"table": (3e-4, 0.99)}, creep=creep)
        own = _core.predict(core, seen, gains, given=50)
        assert own["finite"]
        found.append(float((own["residuals"] ** 2).sum()) + own["log_det"])
    held, creeping = found
    assert creeping < held - 500.0
