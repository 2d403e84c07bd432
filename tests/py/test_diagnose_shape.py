"""Along which coordinates the missing torque is drawn, and that the right one explains it."""

from __future__ import annotations

import numpy as np

from dualdrive.demo import records, sheet
from dualdrive.diagnose.shape import of_the_balance, shapes
from dualdrive.replay import deflections
from dualdrive.traces import Trace

SLOPE = 2e10  # N*m at the table per rad of deflection: beside it the demo's friction is nothing


def test_a_torque_that_follows_a_deflection_is_a_line_along_it() -> None:
    """Drive 1 is made to push so much more per rad: nothing in the balance takes it up."""
    machine, recorded = sheet(), records()[0]
    core = machine.core
    [twist] = [c.measured for c in deflections(core, recorded) if c.name == "x_1"]
    per_ampere = core.get("motor_1.K_d") * core.get("gearbox_1.ratio") * core.get("mesh_1.ratio")
    pushed = {
        name: recorded[name] + (SLOPE / per_ampere * (twist - twist[-1]) if name == "I_1" else 0.0)
        for name in recorded
    }
    pushed_trace = Trace(t=recorded.t, channels=pushed, name="fit")
    found = shapes(of_the_balance(core, {"fit": pushed_trace}, {"fit": {}}))
    every = {(s.equation, s.coordinate): s for s in found}
    told = every["table", "deflection x_1"]
    assert told.explained > 0.8  # as a staircase of five steps can
    assert all(s.explained < 0.2 for s in found if s.coordinate in ("speed", "angle", "time"))
    slope = np.polyfit(told.at, told.value, 1)[0]
    np.testing.assert_allclose(slope, -SLOPE, rtol=0.03)  # it is missing on the load's side
    assert np.all((told.low < told.value) & (told.value < told.high))


def test_the_best_curve_along_every_coordinate_is_kept() -> None:
    """One that explains nothing says so."""
    found = shapes(of_the_balance(sheet().core, {"fit": records()[0]}, {"fit": {}}), count=1)
    assert [found[0].coordinate, found[-1].explained] == ["direction", 0.0]
    several = ["direction", "speed", "angle", "time", "drive torque"]
    assert sorted(s.coordinate for s in found) == sorted(
        [*several, "deflection x_1", "deflection x_2"]
    )
