"""Parts with states of their own: their scores, and how records begin with them."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from bench_record import grey_box
from dualdrive import Machine, _core
from dualdrive.diagnose.screening import Library, Scored, is_part
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.parts import (
    is_joint,
    may_be_missing,
    part_refitted,
    part_score,
)
from dualdrive.diagnose.selection.refits import refitted
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import (
    GreyBox,
    Variant,
    first_noise,
    inflation,
    maximum_likelihood,
    slopes,
    some,
    values,
)
from test_innovations import bench

Array = NDArray[np.float64]

SOFT = {"stiffness": 260.0}
BRISTLES = {"torque": 3e-4, "stiffness": 0.02, "speed": 1.0, "static_ratio": 1.0}


@functools.cache
def refitted_bench(
    law: str, samples: int, seed: int = 6, **numbers: float
) -> tuple[GreyBox, Fitted]:
    """The bench of the data sheet, its numbers likeliest on a record of one that has a law."""
    real = bench({law: numbers} if numbers else {})
    own = grey_box(Machine.load("bench"), real, samples, seed)
    return own, likeliest(own)


def likeliest(own: GreyBox) -> Fitted:
    """The data sheet's machine at its likeliest."""
    nothing, begin = Variant(own.core), first_noise(own.core, own.records, 1e-2)
    found = maximum_likelihood(own, nothing, own.start(nothing), begin, guessed=True)
    assert found is not None
    point, noise, gains = found
    return Fitted(point, noise, inflation(point), 0.0, gains)


def stiff(soft: bool) -> tuple[GreyBox, Fitted]:
    """A record of one whose shafts give, or do not."""
    return refitted_bench("shaft_compliance@gearboxes", 2000, **(SOFT if soft else {}))


def columns_of(own: GreyBox, leader: Fitted) -> list[Array]:
    return slopes(own, leader.point, range(len(leader.point.theta)), leader.gains)


def with_part(own: GreyBox, leader: Fitted, label: str) -> Variant:
    variants = Library(own.core, own).variants(leader.variant, leader.point)
    [variant] = [v for v in variants if v.label == label]
    assert is_part(variant)
    return variant


def gain_of(own: GreyBox, leader: Fitted, label: str) -> float:
    variant, columns = with_part(own, leader, label), columns_of(own, leader)
    return part_score(own, leader.point, columns, variant, leader.noise).gain


@functools.cache
def score(soft: bool) -> float:
    return gain_of(*stiff(soft), "shaft_compliance@gearboxes")


def test_a_shaft_that_gives_is_seen_by_its_score() -> None:
    assert score(soft=True) > 10.0 * threshold("hopeless")


def test_where_none_gives_there_is_less_to_see() -> None:
    """Not nothing: at the sizes that are tried a shaft is no small change of a stiff machine."""
    assert score(soft=False) < 0.5 * score(soft=True)


@pytest.mark.parametrize("soft", [True, False])
def test_only_a_part_with_which_the_data_sheet_is_likelier_is_followed(soft: bool) -> None:
    own, leader = stiff(soft)
    variant = with_part(own, leader, "shaft_compliance@gearboxes")
    assert is_joint(variant)
    start = own.start(variant)
    found = part_refitted(
        Estimator(own.core, own), own, variant, start, leader.variant, leader.noise, 1.0
    )
    assert (found is not None) == soft


def test_beside_laws_that_leave_noise_bristles_and_limits_have_their_turn_and_no_joint() -> None:
    """A friction that changes with the angle had stood for bristles of 30 times its gain."""
    own, leader = stiff(soft=False)
    variants = {v.label: v for v in Library(own.core, own).variants(leader.variant, leader.point)}
    parts = [v for v in variants.values() if is_part(v)]
    friction = [variants["angle_dependent_friction@table"]]
    tried = {v.label for v in parts if may_be_missing(v, friction)}
    assert {"lugre@table", "current_limit@motors"} <= tried
    assert "shaft_compliance@gearboxes" not in tried
    assert all(may_be_missing(v, []) for v in parts)
    damping = Variant(own.core, (), (("mesh_damping", "meshes"),))
    assert may_be_missing(variants["shaft_compliance@gearboxes"], [*friction, damping])


def limit_score(seed: int, **limit: float) -> float:
    """Of a torque limit beside the data sheet, on a record of one that has it, or none."""
    law = "current_limit@motors"
    return gain_of(*refitted_bench(law, 4000, seed, **limit), law)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_limit_that_is_met_in_a_few_samples_is_seen_by_its_score(seed: int) -> None:
    """Noise lifts what but half a per cent of the samples lie below beyond the limit itself."""
    assert limit_score(seed, T_max=0.07) > 4.0 * threshold("hopeless")


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_no_limit_scores_where_none_is_met(seed: int) -> None:
    assert limit_score(seed) < 2.0 * threshold("hopeless")


LATE_LOOP = "sensor_delay@motors"


@functools.cache
def late_bench(time: float) -> tuple[GreyBox, Fitted]:
    """A record of one whose drives have their speeds late, and show their angles so, or do not."""
    late = {"theta_1": time, "theta_2": time}
    own = grey_box(Machine.load("bench"), bench({LATE_LOOP: {"time": time}}), 3000, 6, late=late)
    return own, likeliest(own)


@pytest.mark.parametrize("time", [6e-4, 1.9e-3])
def test_a_speed_that_its_loop_has_late_is_found_at_its_size(time: float) -> None:
    own, leader = late_bench(time)
    variant, columns = with_part(own, leader, LATE_LOOP), columns_of(own, leader)
    scored = Scored(variant, float("nan"), {})
    found = refitted(Estimator(own.core, own), own, leader, scored, columns)
    assert found is not None
    [told] = values(variant.extra, found[0].theta[own.shared :]).values()
    assert told == pytest.approx(time, rel=0.06)  # the record has it to second order


@pytest.mark.parametrize("label", [LATE_LOOP, "sensor_delay@table"])
def test_none_is_late_where_none_is(label: str) -> None:
    """A delay of half a sample and more moves noise by a sample, which had been taken for gain."""
    own, leader = late_bench(0.0)
    assert gain_of(own, leader, label) < threshold("hopeless")


def test_another_sensor_is_not_taken_for_the_late_ones() -> None:
    own, leader = late_bench(1.9e-3)
    assert gain_of(own, leader, "sensor_delay@table") < 0.01 * gain_of(own, leader, LATE_LOOP)


def test_a_limit_that_few_samples_in_a_thousand_meet_is_told_by_its_score() -> None:
    """Voltage of a short move amid slow ones: nearly all samples lie below two thirds of it."""
    law, limit = "voltage_limit@motors", 1.8
    move = _core.jerk_limited_move(3e-3, 0.2, 20.0, 8e3, start=1.0)
    back = _core.scale(_core.jerk_limited_move(3e-3, 0.2, 20.0, 8e3, start=2.0), -1.0)
    slow = _core.cycle_of_moves([0.0, 0.02, -0.02, 0.0], 0.03, 1.0, 20.0)
    motion = _core.sum([slow, move, back])
    own = grey_box(Machine.load("bench"), bench({law: {"U_max": limit}}), 4000, 6, motion=motion)
    leader = likeliest(own)
    variant = with_part(own, leader, law)
    [size] = variant.extra
    assert size.scale < 0.66 * limit
    told = part_score(own, leader.point, columns_of(own, leader), variant, leader.noise)
    assert told.gain > threshold("hopeless")
    assert size.value(float(told.start[-1])) == pytest.approx(limit, rel=0.1)


def test_bristles_that_the_data_sheet_does_not_speak_for_are_found_beside_the_leader() -> None:
    """A first correction that bent them further than they slide had hidden them from any refit."""
    own, leader = refitted_bench("lugre@motors", 4000, **BRISTLES)
    scored = Scored(with_part(own, leader, "lugre@motors"), float("nan"), {})
    near = refitted(Estimator(own.core, own), own, leader, scored, columns_of(own, leader))
    assert near is not None
    assert leader.point.minus_two_log - near[0].minus_two_log > 1000.0
    told = values(scored.variant.extra, near[0].theta[own.shared :])
    assert told["lugre@motors.torque"] == pytest.approx(BRISTLES["torque"], rel=0.01)
    assert told["lugre@motors.stiffness"] == pytest.approx(BRISTLES["stiffness"], rel=0.01)


def test_a_stretch_begins_with_its_shafts_wound_up() -> None:
    """The filter of a stiff machine knew no shaft: one that begins unwound and at rest is lost."""
    own, leader = stiff(soft=True)
    few = some(own, leader.point, leader.gains, 1000)
    variant = with_part(own, leader, "shaft_compliance@gearboxes")
    theta = few.start(variant)
    theta[few.shared] = variant.extra[0].coordinate(260.0)
    [found] = few.likelihoods(variant, [(theta, leader.noise)])
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
