"""Structural effects that are off: the size at which they are probed and from which fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.replay import Record, ratio_to_table

Array = NDArray[np.float64]

#: of the play in the mesh behind it: where play of a reducer begins
_OF_MESH = 0.2
#: share of the samples below what is taken for the peak: noise is above it
_PEAK = 0.995

#: of the steps from reading to reading, by which these may differ: more, and an encoder is too
#: coarse, or too noisy, for a speed (of noise alone they differ by 1.7)
_COARSE = 0.5


def sizes_of_part(
    core: Any, effect: Mapping[str, Any], played: Sequence[Record]
) -> dict[str, float]:
    """Path -> where to begin with each number of a structural effect that is off.

    A torque limit begins where the largest torque recorded of its motors lies but for the noise,
    from the current where that alone was recorded; a voltage limit at the largest voltage, or where
    that was not recorded at what current and speed need, R I + L dI/dt + C_e omega; neither
    where nothing of it was recorded, or the machine's own limit lies below. Play of a reducer
    begins at a fifth of that in its mesh.
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
        peaks = _peaks(core, effect["members"], name, played)
        if peaks and 0.0 < min(peaks) < max(core.get(member) for member in core.members(path)):
            found[path] = min(peaks)
    return found


def _peaks(core: Any, motors: Sequence[str], limit: str, played: Sequence[Record]) -> list[float]:
    """Largest size of what a limit limits, over all records, of every motor that has it."""
    if limit not in ("T_max", "U_max"):
        return []
    of = _torques if limit == "T_max" else _voltages
    found = []
    for motor in motors:
        own = [
            float(np.quantile(np.abs(x), _PEAK))
            for record in played
            for x in of(core, motor, record)
        ]
        if own:
            found.append(max(own))
    return found


def _torques(core: Any, motor: str, record: Record) -> list[Array]:
    """Of a motor, N*m, as recorded and by its current."""
    n, trace = motor.rpartition("_")[2], record.trace
    factors = {f"T_{n}": 1.0, f"I_{n}": core.get(f"{motor}.K_d")}
    return [factor * trace[name] for name, factor in factors.items() if name in trace]


def _voltages(core: Any, motor: str, record: Record) -> list[Array]:
    """Of a motor, V, as recorded, else by its current and speed (physics.md, the armature)."""
    n, trace = motor.rpartition("_")[2], record.trace
    if f"U_{n}" in trace:
        return [trace[f"U_{n}"]]
    if f"I_{n}" not in trace:
        return []
    current, numbers = trace[f"I_{n}"], {k: core.get(f"{motor}.{k}") for k in ("R", "L", "C_e")}
    ratio = ratio_to_table(core, motor)
    known = {f"theta_{n}": 1.0, "theta_m": ratio}
    angles = [factor * trace[name] for name, factor in known.items() if name in trace]
    fine = [x for x in angles if np.std(np.diff(x, 2)) < _COARSE * np.std(np.diff(x))]
    angle = [*fine, ratio * record.reference][0]
    return [
        numbers["R"] * current
        + numbers["L"] * np.gradient(current, trace.t)
        + numbers["C_e"] * np.gradient(angle, trace.t)
    ]
