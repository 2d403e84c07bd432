"""Structural effects that are off: the size at which they are probed and from which fitted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from dualdrive.replay import Record

#: of the play in the mesh behind it: where play of a reducer begins
_OF_MESH = 0.2
#: of the most that was recorded: a limit there is met, and not met by much
_SHARE = 0.95


def sizes_of_part(
    core: Any, effect: Mapping[str, Any], played: Sequence[Record]
) -> dict[str, float]:
    """Path -> where to begin with each number of a structural effect that is off.

    A torque limit begins at 95 % of the largest torque recorded of its motors, from the current
    where that alone was recorded; a voltage limit at 95 % of the largest voltage; neither where
    nothing of it was recorded. Play of a reducer begins at a fifth of that in its mesh.
    """
    found = {}
    for name in effect["parameters"]:
        path = f"{effect['label']}.{name}"
        if name == "gap":
            behind = [f"mesh_{joint.rpartition('_')[2]}" for joint in effect["members"]]
            gaps = [core.get(f"{mesh}.gap") for mesh in behind if mesh in core.connections]
            if sum(gaps) > 0.0:
                found[path] = _OF_MESH * sum(gaps) / len(gaps)
            continue
        limits = [core.get(member) for member in core.members(path)]
        if np.isinf(limits).any():
            peak = max(_recorded(core, effect["members"], name, played), default=0.0)
            if peak > 0.0:
                found[path] = _SHARE * peak
    return found


def _recorded(
    core: Any, motors: Sequence[str], limit: str, played: Sequence[Record]
) -> Iterator[float]:
    """Largest size of what a limit limits, of every record and motor that has it."""
    for record in played:
        for motor in motors:
            n = motor.rpartition("_")[2]
            channels = {
                "T_max": {f"T_{n}": 1.0, f"I_{n}": core.get(f"{motor}.K_d")},
                "U_max": {f"U_{n}": 1.0},
            }
            for channel, factor in channels.get(limit, {}).items():
                if channel in record.trace:
                    yield factor * float(np.max(np.abs(record.trace[channel])))
                    break
