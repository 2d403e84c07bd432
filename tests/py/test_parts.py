"""Parts with states of their own: their scores, and how records begin with them."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library, Scored
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.parts import is_joint, is_part, part_refitted, part_score
from dualdrive.diagnose.selection.refits import refitted
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import (
    GreyBox,
    Noise,
    Point,
    Variant,
    first_noise,
    inflation,
    maximum_likelihood,
    slopes,
    some,
    values,
)
from test_innovations import bench

SOFT = {"shaft_compliance@gearboxes": {"stiffness": 260.0}}


@functools.cache
def stiff(soft: bool) -> tuple[GreyBox, Point, Noise, list[Any]]:
    """The bench of the data sheet on a record of one whose shafts give, or do not."""
    own = grey_box(Machine.load("bench"), bench(SOFT if soft else {}), 2000, seed=6)
    nothing = Variant(own.core)
    found = maximum_likelihood(
        own, nothing, own.start(nothing), first_noise(own.core, own.records, 1e-2)
    )
    assert found is not None
    return own, *found


def shaft(own: GreyBox, point: Point) -> Variant:
    [variant] = [
        v
        for v in Library(own.core, own).variants(point.variant, point)
        if v.effects[-1] == ("shaft_compliance", "gearboxes")
    ]
    return variant


@functools.cache
def score(soft: bool) -> float:
    own, point, noise, gains = stiff(soft)
    columns = slopes(own, point, range(len(point.theta)), gains)
    variant = shaft(own, point)
    assert is_part(variant)
    assert is_joint(variant)
    return part_score(own, point, columns, variant, noise).gain


def test_a_shaft_that_gives_is_seen_by_its_score() -> None:
    assert score(soft=True) > 10.0 * threshold("hopeless")


def test_where_none_gives_there_is_less_to_see() -> None:
    """Not nothing: at the sizes that are tried a shaft is no small change of a stiff machine."""
    assert score(soft=False) < 0.5 * score(soft=True)


@pytest.mark.parametrize("soft", [True, False])
def test_only_a_part_with_which_the_data_sheet_is_likelier_is_followed(soft: bool) -> None:
    own, point, noise, _ = stiff(soft)
    variant = shaft(own, point)
    found = part_refitted(
        Estimator(own.core, own), own, variant, own.start(variant), point.variant, noise
    )
    assert (found is not None) == soft


def limit_score(torque: float) -> float:
    """Of a torque limit beside the bench of the data sheet, on a record of one that has it."""
    own = grey_box(
        Machine.load("bench"), bench({"current_limit@motors": {"T_max": torque}}), 4000, seed=6
    )
    nothing, begin = Variant(own.core), first_noise(own.core, own.records, 1e-2)
    found = maximum_likelihood(own, nothing, own.start(nothing), begin)
    assert found is not None
    point, noise, gains = found
    columns = slopes(own, point, range(len(point.theta)), gains)
    [variant] = [
        v
        for v in Library(own.core, own).variants(nothing, point)
        if v.label == "current_limit@motors"
    ]
    return part_score(own, point, columns, variant, noise).gain


def test_a_limit_that_is_met_in_a_few_samples_is_seen_by_its_score() -> None:
    """Noise lifts what but half a per cent of the samples lie below beyond the limit itself."""
    assert limit_score(0.07) > 4.0 * threshold("hopeless")


BRISTLES = {"torque": 3e-4, "stiffness": 0.02, "speed": 1.0, "static_ratio": 1.0}  # at motors


def test_bristles_that_the_data_sheet_does_not_speak_for_are_found_beside_the_leader() -> None:
    """A first correction that bent them further than they slide had hidden them from any refit."""
    own = grey_box(Machine.load("bench"), bench({"lugre@motors": BRISTLES}), 4000, seed=6)
    nothing, begin = Variant(own.core), first_noise(own.core, own.records, 1e-2)
    found = maximum_likelihood(own, nothing, own.start(nothing), begin)
    assert found is not None
    point, noise, gains = found
    [variant] = [
        v for v in Library(own.core, own).variants(nothing, point) if v.label == "lugre@motors"
    ]
    columns = slopes(own, point, range(len(point.theta)), gains)
    leader = Fitted(point, noise, inflation(point), 0.0, gains)
    near = refitted(
        Estimator(own.core, own), own, leader, Scored(variant, float("nan"), {}), columns
    )
    assert near is not None
    assert point.minus_two_log - near[0].minus_two_log > 1000.0
    told = values(variant.extra, near[0].theta[own.shared :])
    assert told["lugre@motors.torque"] == pytest.approx(BRISTLES["torque"], rel=0.01)
    assert told["lugre@motors.stiffness"] == pytest.approx(BRISTLES["stiffness"], rel=0.01)


def test_a_stretch_begins_with_its_shafts_wound_up() -> None:
    """The filter of a stiff machine knew no shaft: one that begins unwound and at rest is lost."""
    own, point, noise, gains = stiff(soft=True)
    few = some(own, point, gains, 1000)
    variant = shaft(own, point)
    theta = few.start(variant)
    theta[few.shared] = variant.extra[0].coordinate(260.0)
    [found] = few.likelihoods(variant, [(theta, noise)])
    assert found is not None
    [record] = few.records
    core = few.machine(variant, theta)
    for sample, state in zip(record.sampled.starts, record.initial(core, {}), strict=True):
        begun = found[0].residuals[0][sample + 50 : sample + 200]
        assert np.mean(begun**2) < 1.5
        for n in "12":
            ratio = core.get(f"gearbox_{n}.ratio")
            assert state[f"omega_{n}"] == pytest.approx(ratio * state[f"omega_c{n}"])
            wound = state[f"gearbox_{n}.twist"] * core.get(f"gearbox_{n}.stiffness")
            given = ratio * core.get(f"motor_{n}.K_d") * state[f"I_{n}"]
            assert wound == pytest.approx(given, rel=1e-9)
