"""Which equation fails: a known fault is put into a simulated machine and must be found there."""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dualdrive import Machine
from dualdrive.compare import EquationAtFault, equation_at_fault
from dualdrive.compare.controller import asked_torques, commanded_record
from dualdrive.compare.excuses import alike, first_point, noise_alone, refitted
from dualdrive.compare.held import hold
from dualdrive.compare.likelihood import _likeliest, blocks
from dualdrive.identify import Processing, with_torques
from dualdrive.identify.filtering import pieces
from recorded import demo, sheet
from simulated import drifted, nominal, record

#: half the samples that are usual; a plain fault shows in them as well, and in three of four moves
FEWER = Processing(decimate=10)
MOVES = (0.0, 10.0)


@functools.cache
def found(name: str) -> EquationAtFault | None:
    machine = nominal()
    FAULTS[name](machine)
    return equation_at_fault(drifted(), record(machine).between(*MOVES), processing=FEWER)


FAULTS: dict[str, Callable[[Machine], object]] = {
    "none": lambda m: None,
    "motor_1": lambda m: m.add("coulomb", "motor_1", torque=4.0),
    "motor_2": lambda m: m.add("cogging", "motor_2", amplitude=4.0, order=8),
    "motors": lambda m: m.add("coulomb", "motors", torque=4.0),
    "mesh_1": lambda m: m.add("eccentricity", "pinion_1", amplitude=5e-4),
}


@pytest.mark.parametrize("name", [n for n in FAULTS if n != "none"])
def test_the_equation_with_the_fault_is_named(name: str) -> None:
    fault = found(name)
    assert fault is not None
    assert fault.name == name, fault
    assert fault.probability > 0.9
    assert 0.6 < fault.shares[name] <= 1.0


def test_drifted_numbers_alone_are_no_fault() -> None:
    assert found("none") is None


@pytest.mark.parametrize("name", ["fit", "held_out"])
def test_the_demo_lacks_something_at_the_table(name: str) -> None:
    """Its records come from the independent reference model with dry friction of 12 kN m there."""
    fault = equation_at_fault(sheet(), demo(name))
    assert fault is not None
    assert (fault.name, fault.probability > 0.95) == ("table", True)
    assert equation_at_fault(sheet(torque=12000.0), demo(name)) is None


def test_a_record_of_which_no_sample_counts_has_no_correlation_time() -> None:
    """As one that rests all the time, where samples near standstill are masked."""
    core = nominal().core
    held = hold(core, with_torques(core, record(nominal())), "record", Processing(decimate=5))
    alone = first_point(core, [held])
    [row] = alone.rows
    resting = replace(row, held=replace(row.held, keep=np.zeros_like(row.keep)))
    both = replace(alone, rows=[row, resting])
    sums = np.ones(int(row.keep.sum()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert alike(both) == alike(alone)
        np.testing.assert_array_equal(blocks([sums], both), blocks([sums], alone))


def test_a_zero_that_no_sample_tells_of_stays_where_it_is() -> None:
    """As where a drive's flanks stay open all the time."""
    core = nominal().core
    held = hold(core, with_torques(core, record(nominal())), "record", Processing(decimate=5))
    point = first_point(core, [held])
    blind = replace(point, rows=[replace(r, angles=0.0 * r.angles) for r in point.rows])
    assert refitted(blind, noise_alone, 1).zeros == point.zeros


def test_without_motor_angles_the_sum_alone_can_be_told() -> None:
    trace = demo("fit").without("theta_1", "theta_2")
    fault = equation_at_fault(sheet(), trace)
    assert fault == EquationAtFault("total", 1.0, {"total": 1.0})


@pytest.mark.parametrize(
    ("change", "processing"),
    [
        (lambda m: m.set("controller.K_v", 5.6), FEWER),
        (lambda m: m.set("controller.T_ten", 22.0), None),
        (lambda m: m.add("sensor_delay", "table", time=0.004), FEWER),
    ],
    ids=["gain", "tension", "late sensor in the loop"],
)
def test_a_controller_that_is_another_is_told_from_the_plant(
    change: Callable[[Machine], object], processing: Processing | None
) -> None:
    machine = nominal()
    change(machine)
    trace = record(machine).between(*MOVES)
    fault = equation_at_fault(drifted(), trace, processing=processing)
    assert fault is not None
    assert (fault.name, fault.probability > 0.9) == ("controller", True)


def test_the_law_answers_recorded_motion_with_the_recorded_torque() -> None:
    """Three records: of this loop, of one with dry friction more, of one with another gain."""
    process = Processing(decimate=5)

    def off(machine: Machine) -> float:
        core, trace = nominal().core, record(machine)
        trace = with_torques(core, trace)
        played = commanded_record(core, trace, "record")
        (part,) = pieces(trace, "record", process)
        assert played is not None
        asked = asked_torques(core, played, part)
        assert asked is not None
        measured = process.low_pass(part.samples["T_1"], part.step)
        left = process.reduce(asked[0] - measured, part.step)
        return float(np.std(left) / np.std(process.reduce(measured, part.step)))

    rougher, quicker = nominal(), nominal()
    rougher.add("coulomb", "motor_1", torque=4.0)
    quicker.set("controller.K_v", 5.5)
    assert off(nominal()) < 0.02
    assert off(rougher) < 0.02
    assert off(quicker) > 0.06


def test_a_torque_that_no_equation_shows_has_a_size_without_overflow() -> None:
    """Its variance along no direction at all is as good as infinite: no number is NaN for it."""
    seen = (np.ones(50), np.zeros((50, 1)), np.zeros((50, 1)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kappa, size = _likeliest([seen], 1e300, 1)
    assert kappa == pytest.approx(1.0, rel=0.2), "noise of variance one"
    assert math.isfinite(size)
