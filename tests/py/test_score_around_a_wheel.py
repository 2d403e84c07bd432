"""Score tests of what sits somewhere around a wheel: a second pinion, a worn range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine, _core
from dualdrive.diagnose.screening import Library, Scored, scores
from dualdrive.innovations import GreyBox, Variant, first_noise, predictable, slopes
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from test_innovations import CHANNELS, STEP, bench, coloured, run

SAMPLES = 9000
TURN = _core.cycle_of_moves([0.0, 2.5, -2.0, 0.0], 1.0, 4.0, 80.0)
SWING = _core.cycle_of_moves([0.0, 0.4, -0.3, 0.0, 0.4, -0.3, 0.0], 0.4, 4.0, 80.0)
AMPLITUDE, PHASE = 2e-4, 0.5
DEPTH = 3e-4


def record(law: str, numbers: Mapping[str, float], motion: Any) -> Trace:
    clean = run(bench({law: dict(numbers)}), {"theta_ref": motion}, SAMPLES)
    seen = clean + coloured(np.random.default_rng(1), SAMPLES)
    t = STEP * np.arange(SAMPLES, dtype=np.float64)
    columns = dict(zip(CHANNELS, seen.T, strict=True))
    return Trace(t, {"theta_ref": motion.value(t), **columns}, name="record")


def scored(law: str, numbers: Mapping[str, float], motion: Any = TURN) -> Scored:
    """The score of a law that a record holds, beside a machine without it."""
    machine = Machine.load("bench")
    core = core_of(machine)
    trace = record(law, numbers, motion)
    own = GreyBox(core, predictable(core, records(machine, {"record": trace})), [])
    nothing = Variant(own.core)
    wide = first_noise(own.core, own.records, 0.1)
    [found] = own.likelihoods(nothing, [(own.start(nothing), wide)])
    assert found is not None
    point, gains = found
    wanted = [v for v in Library(core, own).variants(nothing, point) if v.label == law]
    columns = slopes(own, point, range(len(point.theta)), gains)
    [best] = scores(own, point, columns, wanted, gains, 1.0)
    return best


@pytest.mark.parametrize("spacing", [0.0, 0.4 * math.pi, -0.7 * math.pi, math.pi])
def test_the_score_finds_how_far_apart_the_pinions_are(spacing: float) -> None:
    wheel = {"amplitude": AMPLITUDE, "phase": PHASE, "spacing": spacing}
    best = scored("eccentricity@table", wheel)
    apart = best.start["eccentricity@table.spacing"] - spacing
    assert abs(math.remainder(apart, 2.0 * math.pi)) < 0.2
    assert best.start["eccentricity@table.amplitude"] == pytest.approx(AMPLITUDE, rel=0.1)
    off = best.start["eccentricity@table.phase"] - PHASE
    assert abs(math.remainder(off, 2.0 * math.pi)) < 0.2


@pytest.mark.parametrize(
    ("motion", "centre", "width", "tried"),
    [
        (TURN, 1.5, 0.4, 0.06 * 4.5),  # of the way that the table turns through, the nearer range
        (TURN, -1.2, 0.4, 0.06 * 4.5),
        (TURN, 2.0, 1.3, 0.2 * 4.5),
        (SWING, 0.2, 0.05, 0.06 * 0.7),
        (SWING, -0.1, 0.12, 0.2 * 0.7),
    ],
)
def test_the_score_finds_where_a_ring_is_worn(
    motion: Any, centre: float, width: float, tried: float
) -> None:
    worn = {"depth": DEPTH, "centre": centre, "width": width}
    best = scored("wear@table", worn, motion)
    assert best.gain > 3.0  # beside much unknown torque
    off = best.start["wear@table.centre"] - centre
    assert abs(math.remainder(off, 2.0 * math.pi)) < 0.5 * width
    assert best.start["wear@table.width"] == pytest.approx(tried, rel=1e-3)
    assert best.start["wear@table.depth"] == pytest.approx(DEPTH, rel=0.3)
