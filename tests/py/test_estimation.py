"""A law comes near its best under less unknown torque; a search knows when to leave one.

The record is that of a bench with one motor's encoder late; see `test_likelihood`.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.contest import Contest
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import EFFORTS, Fitted
from dualdrive.diagnose.work import Leader
from dualdrive.innovations import GreyBox, Point, Variant, maximum_likelihood
from test_innovations import bench

SAMPLES, SEED = 3000, 5
LATE, LATER = 2e-3, 4e-3  # s


@functools.cache
def fitted(late: float = LATE) -> tuple[Estimator, GreyBox, Fitted]:
    """What the machine of the data sheet, its encoder not late, leaves of the records."""
    grey = grey_box(Machine.load("bench"), bench(), SAMPLES, SEED, late={"theta_1": late})
    estimator, nothing = Estimator(grey.core, grey), Variant(grey.core)
    base = estimator.from_far(grey, nothing, grey.start(nothing))
    assert base is not None
    return estimator, grey, base


def law(label: str, late: float = LATE) -> Point:
    """Beside the base, at the size at which a law begins."""
    _, grey, base = fitted(late)
    known = Library(grey.core, grey).variants(base.variant, base.point)
    variant = next(v for v in known if v.label == label)
    start = np.r_[base.point.theta, [p.start for p in variant.extra]]
    [point] = grey.points([variant], [start], base.gains)
    return point


@functools.cache
def compared() -> tuple[Fitted, ...]:
    estimator, grey, base = fitted()
    contest = Contest(
        estimator, Library(grey.core, grey), grey, EFFORTS["normal"], Leader(), lambda _: None, {}
    )
    laws = [law("viscous@table"), law("sensor_delay@theta_1")]
    return tuple(contest.compared([(p, base.noise) for p in laws]))


def time(f: Fitted) -> float:
    """How late the encoder is, s."""
    return float(f.variant.extra[-1].value(float(f.point.theta[-1])))


@pytest.mark.long
def test_a_law_arrives_from_the_noise_of_a_machine_without_it() -> None:
    """Though a torque of unknown course had borne there what the delay does."""
    estimator, grey, base = fitted(LATER)
    begin = law("sensor_delay@theta_1", LATER)
    at_once = estimator.likeliest(grey, begin.variant, begin.theta, base.noise)
    assert at_once is not None
    assert time(at_once) == pytest.approx(LATER, rel=0.01)


@pytest.mark.long
def test_what_leaves_noise_leads() -> None:
    best = compared()[0]
    assert best.variant.label == "sensor_delay@theta_1"
    assert time(best) == pytest.approx(LATE, rel=0.02)
    estimator, grey, base = fitted()
    contest = Contest(
        estimator, Library(grey.core, grey), grey, EFFORTS["normal"], Leader(), lambda _: None, {}
    )
    assert contest.leaves_noise(best)
    assert not contest.leaves_noise(base)


def test_what_is_far_from_a_law_that_leaves_noise_is_no_rival() -> None:
    assert [f.variant.label for f in compared()] == ["sensor_delay@theta_1"]


@pytest.mark.long
def test_a_search_that_would_not_come_up_to_a_rival_is_left() -> None:
    estimator, grey, base = fitted()
    nothing, start = base.variant, grey.start(base.variant)

    def searched(rival: float) -> tuple[float, int]:
        before = grey.counter.replays
        found = maximum_likelihood(
            grey, nothing, start, estimator.wide, floor=estimator.floor, rival=rival
        )
        assert found is not None
        return found[0].minus_two_log, grey.counter.replays - before

    whole, replays = searched(-np.inf)
    out_of_reach, few = searched(10.0 * compared()[0].point.minus_two_log)
    assert few < 0.8 * replays
    assert out_of_reach > whole
    # one that it can come up to does not stop it
    assert searched(whole + 1000.0)[1] > few
