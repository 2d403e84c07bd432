"""A limiter that slides along its limit when the command jumps: nothing holds the ride then."""

from __future__ import annotations

import numpy as np
import pytest

from dualdrive import _core
from test_replay_riding import SWAYING, machine

JUMP, LIMIT = 1.428, 0.05  # s, amid a ride; N*m
BESIDE = 1e-7  # s, before and after


def torques(limit: float, step: float, engine: str) -> tuple[np.ndarray, list[tuple[str, str]]]:
    """The first motor's commanded torque before and after the jump, and its limiter's switches."""
    core = machine()
    core.set("motors.T_max", limit)
    command = SWAYING["theta_ref"] + _core.step(step, JUMP)
    times = [JUMP - BESIDE, JUMP + BESIDE]
    found = _core.simulate(
        core, {"theta_ref": command}, end=1.44, times=times, signals=["T_1*"], engine=engine
    )
    switches = [(e[2], e[3]) for e in found.events if e[0] == JUMP and "speed_1" in e[1]]
    return found.values[:, 0], switches


@pytest.mark.parametrize("engine", ["exact", "explicit", "cvode"])
def test_a_jump_inward_leaves_the_limit_at_once(engine: str) -> None:
    """By as much as it does where there is no limit: the integrator does not jump with it.

    It had been carried along, so that the torque stayed on its limit for 3.5 ms more.
    """
    free, _ = torques(1e3, -1e-3, engine)
    limited, switches = torques(LIMIT, -1e-3, engine)
    assert limited[0] == LIMIT
    assert limited[1] - LIMIT == pytest.approx(free[1] - free[0], rel=1e-3)
    assert free[1] - free[0] < -1e-3
    assert switches == [("riding high", "linear")]


@pytest.mark.parametrize("engine", ["exact", "cvode"])
def test_a_jump_outward_is_borne_by_the_limit(engine: str) -> None:
    limited, switches = torques(LIMIT, 1e-3, engine)
    assert limited == pytest.approx([LIMIT, LIMIT])
    assert switches == [("riding high", "high")]
