"""Records that begin some seconds after the drives were switched on."""

from __future__ import annotations

import pytest

from dualdrive import Machine
from dualdrive.compare import compare
from dualdrive.replay import records
from recorded import sheet
from test_compare import begun_at


def slow() -> Machine:
    """A tension that takes some ten seconds to come in."""
    machine = sheet()
    machine.core.set_controller("master_slave", equaliser="slave")
    machine.set("controller.K_v", 1.0)
    return machine


@pytest.mark.parametrize("since", [1.0, 3.0])
def test_what_has_not_died_away_is_told_from_the_record(since: float) -> None:
    """A loop that had settled for ever, or began at rest, leaves a tension that comes in."""
    trace = begun_at(slow(), since, 0.0)
    [played] = records(slow(), {"own": trace})
    assert played.start == "settled"
    assert float(played.t[0]) - played.begin == pytest.approx(since, rel=0.03)
    error = compare(slow(), trace).error["headline"]
    assert error < 1e-3
    for start in ("rest", "settled"):
        assert compare(slow(), trace, start=start).error["headline"] > 5 * error


def test_a_loop_that_had_settled_is_taken_for_one() -> None:
    machine = slow()
    [asked] = records(machine, {"own": begun_at(machine, 60.0, 0.0)}, start="settled")
    [found] = records(machine, {"own": begun_at(machine, 60.0, 0.0)})
    assert found.begin == asked.begin
