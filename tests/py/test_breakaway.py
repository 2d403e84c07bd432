"""A body at rest must not sleep through an input that comes and goes between two steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dualdrive import Machine, _core, simulate

FRICTION, AMPLITUDE, FREQUENCY = 20.0, 60.0, 0.3


def rubbing_axis() -> _core.Machine:
    machine = _core.Machine()
    machine.add_body("table")
    machine.add_motor("motor_1", "table", "direct")
    machine.add_effect("coulomb", "table")
    machine.set("table.J", 95.0)
    machine.set("table.b", 200.0)
    machine.set("coulomb@table.torque", FRICTION)
    return machine


@pytest.mark.parametrize("method", ["adams", "bdf"])
def test_it_breaks_away_whenever_the_torque_exceeds_friction(method: str) -> None:
    drive = _core.sine(AMPLITUDE, FREQUENCY)
    run = _core.simulate(rubbing_axis(), {"T_1": drive}, end=8.0, method=method)
    first = next(event for event in run.events if event[2] == "stuck")
    assert first[0] == pytest.approx(
        math.asin(FRICTION / AMPLITUDE) / (2 * math.pi * FREQUENCY), abs=1e-9
    )
    friction = run.values[:, run.names.index("coulomb@table")]
    assert np.abs(friction).max() <= FRICTION * (1 + 1e-12)


def test_a_short_pulse_in_a_long_rest_is_seen() -> None:
    pulse = _core.sampled(
        [0.0, 50.0, 50.01, 50.02, 100.0], [0.0, 0.0, 400.0, 0.0, 0.0], _core.Interpolation.linear
    )
    run = _core.simulate(rubbing_axis(), {"T_1": pulse}, end=100.0, output_step=1.0)
    assert [event[2:] for event in run.events][:2] == [("stuck", "forward"), ("forward", "stuck")]


@pytest.mark.parametrize("gap", [1.2531328320802006e-05, 2.756892230576441e-05])
def test_a_pinion_that_breaks_away_goes_on(gap: float) -> None:
    """Speed and acceleration are zero then but for rounding, which once told it to stop again."""
    machine = Machine.load("heavy-table-250t")
    machine.set("meshes.gap", gap)
    end = 9.96405499221705
    run = simulate(machine, times=np.linspace(0.0, end, 9965), energy=False)
    assert (run.status, run.message) == ("success", "")
    assert len(run.events) < 100
