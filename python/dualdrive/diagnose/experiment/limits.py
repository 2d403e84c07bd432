"""What an experiment may ask of an axis, and what an axis can do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dualdrive.assembly import gaps
from dualdrive.replay import ratio_to_table

#: how far below its limits a motion is planned; the simulation decides
_PLANNED = 0.5


@dataclass(frozen=True)
class Limits:
    """What an experiment may ask of the axis, all at the table.

    torque:  share of each motor's greatest torque
    speed:   rad/s (m/s); `share of the motors' greatest` unless given
    share:   of the motors' greatest speed
    travel:  farthest from where it stands, rad (m); a full turn unless given, on a linear axis
        what it does in a second
    """

    torque: float = 0.8
    speed: float | None = None
    share: float = 0.8
    travel: float | None = None


@dataclass(frozen=True)
class Axis:
    """What the motions of a menu are scaled to, SI at the table.

    time:   of the position loop, 1/K_v, s; 0.2 where nothing is known of it
    play:   full play between motor and table, 0 without any
    turns:  one turn of each wheel on the way, the longest first; empty on a linear axis
    tension: what the controller is set to, N*m, and the greatest that leaves torque to spare;
        None where it has none
    """

    speed: float
    acceleration: float
    travel: float
    time: float
    play: float
    turns: tuple[float, ...]
    tension: tuple[float, float] | None


def axis_of(core: Any, limits: Limits, *, linear: bool = False) -> Axis:
    """Read what a machine can do from its numbers.

    Raises:
        ValueError: neither machine nor limits tell a greatest speed.

    """
    speed, torque, inertia = _abilities(core)
    speed = limits.share * speed if limits.speed is None else min(limits.speed, speed)
    if not math.isfinite(speed):
        raise ValueError("limits: no motor states omega_max; give Limits(speed=...)")
    controlled = core.controller_options["kind"] != "none"
    gain = core.get("controller.K_v") if controlled else 0.0
    time = 1.0 / gain if gain else 0.2
    strongest = limits.torque * _PLANNED * torque / inertia
    acceleration = min(strongest, speed / time) if inertia > 0 else speed / time
    turns = () if linear else _turns(core)
    travel = (speed if linear else 2 * math.pi) if limits.travel is None else limits.travel
    tension = _tension(core, limits) if controlled and len(core.motors) > 1 else None
    return Axis(speed, acceleration, travel, time, _play(core), turns, tension)


def _abilities(core: Any) -> tuple[float, float, float]:
    """Greatest speed, greatest torque and inertia, all at the table."""
    speeds, torque, inertia = [math.inf], 0.0, core.get("table.J")
    for motor in core.motors:
        ratio = ratio_to_table(core, motor)
        speeds.append(core.get(f"{motor}.omega_max") / ratio)
        torque += core.get(f"{motor}.T_max") * ratio
        inertia += core.get(f"{motor}.J") * ratio**2 if motor in core.bodies else 0.0
    return min(speeds), torque, inertia


def _play(core: Any) -> float:
    """Full play of the first drive, seen at the table."""
    every = [2 * core.get(f"{c}.gap") / ratio_to_table(core, c) for c in gaps(core)]
    return max(every, default=0.0)


def _turns(core: Any) -> tuple[float, ...]:
    bodies = ("table", "pinion_1", "motor_1")
    ratios = {ratio_to_table(core, body) for body in bodies}
    return tuple(2 * math.pi / ratio for ratio in sorted(ratios))


def _tension(core: Any, limits: Limits) -> tuple[float, float] | None:
    if core.controller_options["tension"] == "off":
        return None
    present = abs(core.get("controller.T_ten"))
    weakest = min(core.get(f"{motor}.T_max") for motor in core.motors)
    most = limits.torque * weakest  # each motor carries half: the other half is left for the motion
    return (present, most) if math.isfinite(most) else None


def peaks(core: Any, values: dict[str, Any]) -> float:
    """Largest share of its torque limit that any motor reaches; `values` has T_n or I_n."""
    found = 0.0
    for motor in core.motors:
        n, most = motor.rpartition("_")[2], core.get(f"{motor}.T_max")
        if f"T_{n}" in values and math.isfinite(most):
            found = max(found, float(abs(values[f"T_{n}"]).max()) / most)
    return found


def same(cores: Sequence[Any]) -> bool:
    """Whether all have a controller, or none."""
    return len({core.controller_options["kind"] == "none" for core in cores}) == 1
