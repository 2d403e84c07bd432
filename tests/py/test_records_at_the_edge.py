"""Records and machines at the edge of what a grey box takes: a table at rest, a law of nought."""

from __future__ import annotations

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine, _core
from dualdrive.diagnose.screening import Library, scores
from dualdrive.diagnose.simulated_errors import of_the_data_sheet, simulated_error
from dualdrive.innovations import (
    Point,
    Variant,
    first_noise,
    inflation,
    least_noise,
    maximum_likelihood,
    slopes,
)
from test_innovations import bench

LATE = 1e-4


def test_a_table_that_is_held_has_no_speed_to_creep_by() -> None:
    """Nought over nought ended a diagnosis: creep is counted by the speed that is commanded."""
    machine = Machine.load("bench")
    machine.add("coulomb", "table", torque=0.3)
    own = grey_box(machine, machine.core, 600, 1, motion=_core.constant(0.0))
    nothing = Variant(own.core)
    assert own.resting(nothing) == {}
    noise, floor = (f(own.core, own.records, 0.01) for f in (first_noise, least_noise))
    found = maximum_likelihood(own, nothing, own.start(nothing), noise, floor=floor, steps=2)
    assert found is not None
    assert np.isfinite(found[0].minus_two_log)


@pytest.mark.parametrize(
    "law", [("coulomb", "table"), ("viscous", "table"), ("cogging", "motor_1")]
)
def test_a_law_of_nought_is_nought_in_the_data_sheets_machine(law: tuple[str, str]) -> None:
    """A fit begins with it at its usual size: of 300 N*m the sheet's error was 121, not 0.1."""
    machine = Machine.load("bench")
    machine.add(*law)
    own = grey_box(machine, bench(), 1500, 2)
    given = simulated_error(own.core, [r.record for r in own.records])
    assert of_the_data_sheet(own).error() == pytest.approx(given, rel=0.02)


def test_a_score_of_a_delay_begins_at_the_size_that_it_tells() -> None:
    """It is probed by a part of a sample, and that is what the regression counts in."""
    own = grey_box(Machine.load("bench"), bench(), 3000, 3, late=LATE)
    nothing = Variant(own.core)
    start = own.start(nothing)
    gains = own.gains(nothing, start, first_noise(own.core, own.records, 1e-3))
    [point] = own.points([nothing], [start], gains)
    columns = slopes(own, point, range(len(start)), gains)
    blank = tuple(np.zeros_like(r.measured) for r in own.records)
    known = Library(own.core, own).variants(nothing, Point(nothing, start, blank, 0.0, 0.0))
    [late] = [v for v in known if v.label == "sensor_delay@theta_1"]
    [told] = scores(own, point, columns, [late], gains, inflation(point))
    assert told.start["sensor_delay@theta_1.time"] == pytest.approx(LATE, rel=0.5)
