"""Where a fit of a limit begins that the data sheet does not have: where the records meet it."""

from __future__ import annotations

import numpy as np
import pytest

from dualdrive import Machine, motion, simulate
from dualdrive.identify.parts import sizes_of_part
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace

LIMIT = 12.0  # V, less than the motion would take
ENCODERS = ("theta_1", "theta_2")


def seen(names: tuple[str, ...], step: float = 0.0) -> Trace:
    """The bench at its voltage's limit, voltages not recorded; motors' angles to a step, rad."""
    machine = Machine.load("bench")
    machine.add("voltage_limit", "motors", U_max=LIMIT)
    run = simulate(machine, motion.sine(0.05, 4.0), end=2.0)
    t = np.arange(0.0, 2.0, 1e-3)
    columns = {c: np.interp(t, run.t, run[c]) for c in ("theta_ref", "theta_m", *names)}
    for name in set(ENCODERS) & set(columns) if step else ():
        columns[name] = step * np.round(columns[name] / step)
    return Trace(t, columns, name="record")


# without encoders of their own, or with some that are too coarse for a speed, the motors are taken
# to turn with the table, through soft meshes
@pytest.mark.parametrize(
    ("encoders", "step", "error"),
    [(ENCODERS, 0.0, 0.01), (ENCODERS, 0.5, 0.3), ((), 0.0, 0.3)],
    ids=("fine", "coarse", "none"),
)
def test_a_voltage_limit_begins_at_what_currents_need(
    encoders: tuple[str, ...], step: float, error: float
) -> None:
    machine = Machine.load("bench")
    played = records(machine, {"record": seen(("I_1", "I_2", *encoders), step)})
    grown = core_of(machine).copy()
    grown.add_effect("voltage_limit", "motors")
    [effect] = [e for e in grown.effects if e["effect"] == "voltage_limit"]
    found = sizes_of_part(grown, effect, played)
    assert found == {"voltage_limit@motors.U_max": pytest.approx(LIMIT, rel=error)}


def test_nothing_is_known_of_a_voltage_without_currents() -> None:
    machine = Machine.load("bench")
    grown = core_of(machine).copy()
    grown.add_effect("voltage_limit", "motors")
    [effect] = [e for e in grown.effects if e["effect"] == "voltage_limit"]
    assert sizes_of_part(grown, effect, records(machine, {"record": seen(ENCODERS)})) == {}
