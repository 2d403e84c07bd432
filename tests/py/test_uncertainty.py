"""How far fitted numbers are from a data sheet: Wald's test against a likelihood ratio."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.decision import change_with_time
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.innovations import (
    GreyBox,
    Variant,
    coordinates,
    flat,
    inflation,
    maximum_likelihood,
    slopes,
)
from test_innovations import bench

SAMPLES, SEED = 3000, 11
#: 99.99 % of chi-squared with as many degrees of freedom as the bench has numbers, and more
CHANCE = 45.0


@functools.cache
def fitted(*heavier: float) -> tuple[Estimator, GreyBox, Fitted]:
    """The data sheet's machine on records of one whose table is so much heavier, one for each."""
    machine, own = Machine.load("bench"), list[GreyBox]()
    for k, times in enumerate(heavier):
        true = bench()
        true.set("table.J", times * true.get("table.J"))
        own.append(grey_box(machine, true, SAMPLES, SEED + k))
    every = [record for grey in own for record in grey.records]
    grey = GreyBox(own[0].core, every, own[0].nominal)
    estimator, nothing = Estimator(grey.core, grey), Variant(grey.core)
    near = estimator.from_far(grey, nothing, grey.start(nothing))
    assert near is not None
    found = estimator.likeliest(grey, nothing, near.point.theta, near.noise)
    assert found is not None
    return estimator, grey, found


def distance(heavier: float) -> float:
    _, grey, found = fitted(heavier)
    return Uncertainty(grey).distance(found)


def test_a_right_data_sheet_is_as_near_as_chance_has_it() -> None:
    assert 0.0 < distance(1.0) < CHANCE


def test_a_table_a_tenth_heavier_is_far() -> None:
    assert distance(1.1) > 10.0 * CHANCE


@pytest.mark.parametrize("heavier", [1.0, 1.0002])
def test_near_it_the_distance_is_what_a_likelihood_ratio_says(heavier: float) -> None:
    estimator, grey, found = fitted(heavier)
    begin = found.point.theta.copy()
    begin[: len(grey.nominal)] = grey.centre[: len(grey.nominal)]
    # each goes on from where the other ended: a search ends where steps bring little
    free, held = (
        maximum_likelihood(g, found.variant, theta, found.noise, floor=estimator.floor)
        for g, theta in ((grey, found.point.theta), (grey.held(), begin))
    )
    assert free is not None
    assert held is not None
    ratio = (held[0].minus_two_log - free[0].minus_two_log) / inflation(found.point)
    assert distance(heavier) == pytest.approx(ratio, rel=0.35, abs=3.0)


def test_numbers_that_stay_change_as_noise_has_it() -> None:
    _, grey, found = fitted(1.0, 1.0)
    told = Uncertainty(grey).changing(found)
    assert told.numbers == 15
    assert told.gain < CHANCE + told.numbers
    assert not change_with_time(told, grey.samples)


def test_a_table_that_takes_a_load_between_two_records_does_not_stay() -> None:
    """By four per cent, which a torque of unknown course bears nearly all of."""
    _, grey, found = fitted(1.0, 1.04)
    told = Uncertainty(grey).changing(found)
    assert found.inflation < 1.5
    assert told.name == "table.J"
    assert "table.J does not stay" in change_with_time(told, grey.samples)


def test_what_a_change_would_take_is_the_gain_of_a_regression_on_steps() -> None:
    """By least squares with a number of its own in every block, all others held."""
    _, grey, found = fitted(1.0, 1.04)
    normal = Uncertainty(grey).about(found)
    k = [p.path for p in grey.nominal].index("table.J")
    [column] = slopes(grey, found.point, [k], found.gains)
    r, (n, channels) = flat(found.point.residuals), found.point.residuals[0].shape
    blocks = np.repeat(np.arange(2 * n) * 16 // (2 * n), channels)
    steps = np.where(blocks == np.arange(16)[:, None], column, 0.0).T
    alone, apart = (np.linalg.lstsq(X, r)[1][0] for X in (column[:, None], steps))
    assert normal.changes[k] == pytest.approx((alone - apart) * normal.scale, rel=1e-3)


def test_blocks_of_time_add_up_to_the_information() -> None:
    _, grey, found = fitted(1.0)
    normal = Uncertainty(grey).about(found)
    columns = np.stack(slopes(grey, found.point, range(len(found.point.theta)), found.gains))
    whole = normal.scale * columns @ columns.T + np.diag(normal.precision)
    np.testing.assert_allclose(normal.information, whole, rtol=0.05, atol=1e-3 * whole.max())


def test_phases_are_told_within_half_a_turn_of_zero() -> None:
    _, grey, found = fitted(1.0)
    nothing = found.variant
    [law] = [
        v
        for v in Library(grey.core, grey).variants(nothing, found.point)
        if v.label == "unbalance@table"
    ]
    own = {"amplitude": 0.1, "phase": 0.5 + 2.0 * np.pi}
    numbers = coordinates(law.extra, {p.path: own[p.path.rpartition(".")[2]] for p in law.extra})
    [point] = grey.points([law], [np.r_[found.point.theta, numbers]], found.gains)
    told = Uncertainty(grey).intervals(replace(found, point=point))
    phase = told["unbalance@table.phase"]
    assert phase.value == pytest.approx(0.5)
    assert phase.low < phase.value < phase.high


@pytest.mark.parametrize("off", [0.0, 100.0])
def test_blocks_that_were_left_out_are_no_better_than_those_that_were_fitted(off: float) -> None:
    """Nor where a fit does not end where the filter's would, as that of a simulation does not."""
    _, grey, found = fitted(1.1)
    sure = Uncertainty(grey)
    deviation = np.sqrt(np.diag(sure.about(found).covariance))
    k = [p.path for p in grey.nominal].index("table.J")
    theta = found.point.theta.copy()
    theta[k] += off * deviation[k]
    [point] = grey.points([found.variant], [theta], found.gains)
    simulated = found.noise if off else None
    worse = sure.cross_validated(replace(found, point=point, told_under=simulated))
    assert 1.0 < worse < 1.02
