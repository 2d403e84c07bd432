"""Which order an angle-locked effect has: the one whose harmonics the residual carries.

Harmonics of the angle are fitted to what is left of every series, order by order. A ripple that
grows with the current, or a friction that turns with the speed, is a harmonic carried by that
signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.candidates import parts_of
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.evidence import Evidence
from dualdrive.replay import core_of, ratio_to_table

Array = NDArray[np.float64]

HIGHEST = 100
#: too few turns show these in no spectrum (offsets and gains of current sensors, runout, bearings),
#: and of torques that act slowly a filter leaves hardly anything to one
LOW = (1.0, 2.0, 3.0, 4.0)
_TURN = 0.5  # periods that a record must hold for an order to be seen at all
STANDS_OUT = 25.0  # fall of chi^2 below which no order, and no spot, is named


def strongest_orders(
    evidence: Evidence, rest: Array, place: str, carrier: str = "", count: int = 1
) -> list[tuple[int, float]]:
    """Orders of a place's angle that explain most of the whitened rest, best first.

    Args:
        evidence: the confrontation and its noise.
        rest: whitened rows with the nuisances' share removed, shape (n,).
        place: motor_1, pinion_2, table, ...
        carrier: ``torque`` of the drive, ``direction`` of motion, or none.
        count: how many at most; neighbours of a better one are left out.

    Returns:
        (order, fall of chi^2), only those that stand out.

    """
    gains = np.zeros(HIGHEST + 1)
    c = evidence.confrontation
    parts = evidence.apart(rest)
    for k in range(len(parts)):
        columns = c.columns(k)
        angle = angle_of(c.core, columns, place)
        if angle is None or np.ptp(angle) < 1e-9:
            continue
        white, own = evidence.whiteners[k], parts[k]
        carried = _carried(columns, place, carrier, angle)
        for n in range(1, HIGHEST + 1):
            if n * float(np.ptp(angle)) < 2 * np.pi * _TURN or _too_fast(n * angle):
                continue
            waves = np.stack([np.cos(n * angle), np.sin(n * angle)], axis=1)
            rows = white(carried[:, None] * waves)
            gram = rows.T @ rows
            gram[np.diag_indices(2)] *= 1 + 1e-9
            pull = rows.T @ own
            gains[n] += float(pull @ np.linalg.solve(gram + 1e-300 * np.eye(2), pull))
    found: list[tuple[int, float]] = []
    for n in np.argsort(gains)[::-1]:
        if gains[n] < STANDS_OUT or len(found) == count:
            break
        if all(abs(int(n) - m) > 1 for m, _ in found):
            found.append((int(n), float(gains[n])))
    return found


def _too_fast(phase: Array) -> bool:
    """Whether the harmonic runs past half the sampling rate for most of the record."""
    return bool(np.median(np.abs(np.diff(phase))) > np.pi)


def _carried(columns: Mapping[str, Array], place: str, carrier: str, angle: Array) -> Array:
    """The carrier at the samples of a series, about 1 at most, shape (n,)."""
    if carrier == "direction":
        rate = np.gradient(angle)
        return np.asarray(np.tanh(rate / (0.05 * float(np.std(rate)) + 1e-300)))
    n = place.rpartition("_")[2]
    for name in (f"T_{n}", f"I_{n}", "T_1", "I_1"):
        if carrier == "torque" and name in columns:
            torque = np.asarray(columns[name])
            return np.asarray(torque / (float(np.max(np.abs(torque))) + 1e-300))
    return np.ones(len(angle))


def angle_of(core: Any, columns: Mapping[str, Array], place: str) -> Array | None:
    """Angle of a place from recorded signals, rad: its own, or another's times the ratio."""
    stem, _, n = place.rpartition("_")
    own = {"motor": f"theta_{n}", "pinion": f"theta_c{n}"}.get(stem, "theta_m")
    if own in columns:
        return np.asarray(columns[own])
    for name in (f"theta_{n}", "theta_m", "theta_1"):
        part = {"theta_m": "table"}.get(name, f"motor_{name[-1]}")
        if name in columns and (part == "table" or part in core.motors):
            ratio = ratio_to_table(core, place) / ratio_to_table(core, part)
            return np.asarray(columns[name]) * ratio
    return None


def travel_of(c: TorqueBalance, place: str) -> tuple[float, float] | None:
    """Lowest and highest angle of a place over all records, rad; None where none is recorded."""
    angles = [angle_of(c.core, c.columns(k), place) for k in range(len(c.series))]
    known = [a for a in angles if a is not None]
    if not known:
        return None
    return float(min(a.min() for a in known)), float(max(a.max() for a in known))


def members_of(machine: object, place: str) -> list[str]:
    """The single parts behind a place: motors -> motor_1, motor_2."""
    core = core_of(machine)
    if place in core.motors or place in core.bodies or place in core.connections:
        return [place]
    return parts_of(core, place) or [place]
