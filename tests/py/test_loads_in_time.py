"""A load that sets in and ends: its hour, its wave, and what it would gain, off innovations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.screening import Library, loads, scores
from dualdrive.innovations import GreyBox, Noise, Point, Variant, first_noise
from test_innovations import bench

SAMPLES = 6000
LAW = "cutting_torque@table"
RISE = 0.02  # s, as the law has it
CUT = {"mean": 0.4, "amplitude": 0.2, "frequency": 14.0, "start": 1.3, "duration": 2.4}


def left_by(numbers: dict[str, float]) -> tuple[GreyBox, Point, list[Any], Noise]:
    """What the bench leaves of a record with such a load; none where there are no numbers."""
    true = bench({LAW: numbers} if numbers else {})
    own = grey_box(Machine.load("bench"), true, SAMPLES, 5)
    nothing = Variant(own.core)
    noise = first_noise(own.core, own.records, 0.01)
    [found] = own.likelihoods(nothing, [(own.start(nothing), noise)])
    assert found is not None
    return own, *found, noise


@pytest.mark.parametrize(
    "numbers",
    [CUT, {**CUT, "mean": -0.4}, {**CUT, "frequency": 37.0, "start": 2.1, "duration": 1.0}],
    ids=["against the motion", "with it", "short"],
)
def test_a_load_is_found_at_its_hour_and_its_wave_at_its_frequency(
    numbers: dict[str, float],
) -> None:
    own, point, gains, noise = left_by(numbers)
    [found] = loads(own, point, gains, noise)
    begins = {path.rpartition(".")[2]: x for path, x in found.begins.items()}
    within = 0.25 / numbers["duration"]
    assert begins["frequency"] == pytest.approx(numbers["frequency"], abs=within)
    # the wave begins where the load does, or whole periods before or after
    off = (begins["start"] - numbers["start"]) * numbers["frequency"]
    assert abs(math.remainder(off, 1.0)) < 0.15
    assert begins["start"] == pytest.approx(numbers["start"], abs=0.06)
    end = begins["start"] + begins["duration"]
    assert end == pytest.approx(numbers["start"] + numbers["duration"], abs=0.06)
    [law] = [v for v in Library(own.core, own).variants(point.variant, point, [found]) if hides(v)]
    [score] = scores(own, point, [], [law], gains, 1.0)
    assert score.start[f"{LAW}.mean"] == pytest.approx(numbers["mean"], rel=0.35)
    assert score.start[f"{LAW}.amplitude"] == pytest.approx(numbers["amplitude"], rel=0.35)


def hides(variant: Variant) -> bool:
    return variant.label == LAW


def test_a_load_without_a_wave_has_no_frequency() -> None:
    [found] = loads(*left_by({**CUT, "amplitude": 0.0}))
    assert set(found.begins) == {f"{LAW}.start", f"{LAW}.duration"}


def test_no_load_is_told_where_there_is_none() -> None:
    assert loads(*left_by({})) == []


def test_a_law_that_stands_is_not_put_in_twice() -> None:
    own, point, gains, noise = left_by(CUT)
    [found] = loads(own, point, gains, noise)
    [law] = [v for v in Library(own.core, own).variants(point.variant, point, [found]) if hides(v)]
    there = np.r_[point.theta, [p.centre for p in law.extra]]
    assert loads(own, Point(law, there, point.residuals, 0.0, 0.0), gains, noise) == []


def test_sums_of_scores_tell_what_a_replay_does() -> None:
    """The likelihood ratio of the box is the gain of the law by its replayed innovations."""
    own, point, gains, noise = left_by({**CUT, "amplitude": 0.0})
    from dualdrive.diagnose.screening.likelihood_ratio import _boxes, _score

    column = sorted(noise.torque).index("table")
    known = [_score(own.core, own.records[0], point.residuals[0], gains[0], column, RISE)]
    start, end = CUT["start"], CUT["start"] + CUT["duration"] - RISE
    gain = float(_boxes(known, np.array([start]), np.array([end]))[0, 0])
    begins = {f"{LAW}.start": start, f"{LAW}.duration": CUT["duration"]}
    hypothesis = Hypothesis((("cutting_torque", "table"),), {}, {}, begins)
    variants = Library(own.core, own).variants(point.variant, point, [hypothesis])
    [law] = filter(hides, variants)
    [score] = scores(own, point, [], [law], gains, 1.0)
    assert gain > 500.0
    assert gain == pytest.approx(score.gain, rel=0.05)
