"""What was found on stretches, held against all samples."""

from __future__ import annotations

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.contest import Contest
from dualdrive.diagnose.selection.estimation import Estimator, on_all_samples
from dualdrive.diagnose.selection.fitted import EFFORTS
from dualdrive.diagnose.selection.residual_analysis import white
from dualdrive.diagnose.work import Leader
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import Point, Variant, coordinates
from test_innovations import bench

LAW, TORQUE = "coulomb@table", 0.4


@pytest.mark.long
def test_numbers_that_a_stretch_does_not_tell_begin_again_where_they_fail() -> None:
    """At first the table turns one way alone: how strong dry friction is backwards is not told."""
    own = grey_box(Machine.load("bench"), bench({LAW: {"torque": TORQUE}}), 12000, 3)
    estimator, nothing = Estimator(own.core, own), Variant(own.core)
    blank = tuple(np.zeros_like(r.measured) for r in own.records)
    base = Point(nothing, own.start(nothing), blank, 0.0, 0.0)
    [law] = [v for v in Library(own.core, own).variants(nothing, base) if v.label == LAW]
    few = own.on([r.stretches([(0, 400)], r.begins) for r in own.records])
    near = estimator.from_far(few, law, few.start(law))
    assert near is not None
    there = estimator.likeliest(few, law, near.point.theta, near.noise)
    assert there is not None
    assert white(there)
    assert on_all_samples(own, there).inflation > threshold("inflation")
    said: list[str] = []
    contest = Contest(
        estimator, Library(own.core, own), own, EFFORTS["normal"], Leader(), said.append, {}
    )
    [found] = contest.on_these([there])
    assert f"stretches where {LAW} fails" in said
    torque = own.machine(law, found.point.theta).get(f"{LAW}.torque")
    assert torque == pytest.approx(TORQUE, rel=1e-3)
    true = np.r_[own.start(nothing), coordinates(law.extra, {f"{LAW}.torque": TORQUE})]
    best = estimator.likeliest(own, law, true, found.noise)
    assert best is not None
    assert found.point.minus_two_log < best.point.minus_two_log + 20.0
