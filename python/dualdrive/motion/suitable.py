"""A motion for a machine of which nothing more is said."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .builders import Motion, MotionError, move

if TYPE_CHECKING:
    from dualdrive.machine import Machine

__all__ = ["default_motion"]


def default_motion(machine: Machine) -> Motion:
    """A move that suits the machine: 60 % of its speed, and torque to spare.

    The time scale is that of the position loop, 1/K_v: ten of it to build up tension, fifteen to
    reach the speed limit. The heavy table moves 0.02 rad, as in the study of its hunting.

    Raises MotionError for a machine that can't move.
    """
    speed, acceleration = _limits(machine)
    core = machine.core
    controlled = core.controller_options["kind"] != "none"
    scale = 1.0 / core.get("controller.K_v") if controlled and core.get("controller.K_v") else 0.2
    v = _round(0.6 * speed if math.isfinite(speed) else 0.05 / scale * 0.2)
    a = _round(min(v / (15 * scale), 0.5 * acceleration))
    distance, jerk = _round(3.2 * v * scale), _round(a / scale)
    none = MotionError(
        f"{core.name}: no motion suits it: at a speed of {v:g} and an acceleration of {a:g} "
        "(SI) nothing moves; look at omega_max, T_max, K_v and the inertias, or give a motion"
    )
    if not all(math.isfinite(x) and x > 0.0 for x in (distance, v, a, jerk)):
        raise none
    try:
        return move(distance, v, a, jerk, start=_round(10 * scale), settle=_round(25 * scale))
    except MotionError:  # too long to be held, say
        raise
    except ValueError:
        raise none from None


def _limits(machine: Machine) -> tuple[float, float]:
    """The table's greatest speed and acceleration that the motors can give it."""
    core = machine.core
    speeds, torque, inertia = [math.inf], 0.0, core.get("table.J")
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        ratio = 1.0
        for part in (f"gearbox_{n}", f"mesh_{n}"):
            if part in core.connections:
                ratio *= core.get(f"{part}.ratio")
        speeds.append(core.get(f"{motor}.omega_max") / ratio)
        torque += core.get(f"{motor}.T_max") * ratio
        inertia += core.get(f"{motor}.J") * ratio**2
    return min(speeds), torque / inertia if inertia else math.inf


def _round(value: float) -> float:
    """One significant digit, or two where the first is a one: 0.0314 -> 0.03, 0.0106 -> 0.011."""
    digits = 2 if f"{value:e}"[0] == "1" else 1
    return float(f"{value:.{digits}g}")
