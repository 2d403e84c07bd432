"""A wheel that two pinions meet: the score finds at which angle round it the second one stands."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dualdrive import Machine, _core
from dualdrive.diagnose.screening import Library, scores
from dualdrive.innovations import GreyBox, Variant, first_noise, predictable
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from test_innovations import CHANNELS, STEP, bench, coloured, run

SAMPLES = 9000
TURN = _core.cycle_of_moves([0.0, 2.5, -2.0, 0.0], 1.0, 4.0, 80.0)
AMPLITUDE, PHASE = 2e-4, 0.5


def record(spacing: float) -> Trace:
    wheel = {"amplitude": AMPLITUDE, "phase": PHASE, "spacing": spacing}
    clean = run(bench({"eccentricity@table": wheel}), {"theta_ref": TURN}, SAMPLES)
    seen = clean + coloured(np.random.default_rng(1), SAMPLES)
    t = STEP * np.arange(SAMPLES, dtype=np.float64)
    columns = dict(zip(CHANNELS, seen.T, strict=True))
    return Trace(t, {"theta_ref": TURN.value(t), **columns}, name="record")


@pytest.mark.parametrize("spacing", [0.0, 0.4 * math.pi, -0.7 * math.pi, math.pi])
def test_the_score_finds_how_far_apart_the_pinions_are(spacing: float) -> None:
    machine = Machine.load("bench")
    core = core_of(machine)
    own = GreyBox(core, predictable(core, records(machine, {"record": record(spacing)})), [])
    nothing = Variant(own.core)
    wide = first_noise(own.core, own.records, 0.1)
    [found] = own.likelihoods(nothing, [(own.start(nothing), wide)])
    assert found is not None
    point, gains = found
    wanted = [v for v in Library(core, own).variants(nothing, point) if "eccentric" in v.label]
    columns = own.columns(point, range(len(point.theta)), gains)
    tried = {s.variant.label: s for s in scores(own, point, columns, wanted, gains, 1.0)}
    best = tried["eccentricity@table"]
    apart = best.start["eccentricity@table.spacing"] - spacing
    assert abs(math.remainder(apart, 2.0 * math.pi)) < 0.2
    assert best.start["eccentricity@table.amplitude"] == pytest.approx(AMPLITUDE, rel=0.1)
    off = best.start["eccentricity@table.phase"] - PHASE
    assert abs(math.remainder(off, 2.0 * math.pi)) < 0.2
