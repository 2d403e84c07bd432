"""Which order an angle-locked effect has: the one whose harmonics the residual carries.

A loop changes amplitude and phase of a disturbance, not its order, so harmonics of the angle are
fitted to what is left of every series, order by order.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.evidence import Evidence
from dualdrive.replay import core_of

Array = NDArray[np.float64]

HIGHEST = 100
_TURN = 0.5  # periods that a record must hold for an order to be seen at all
_STANDS_OUT = 25.0  # fall of chi^2 below which no order is named


def strongest_orders(
    evidence: Evidence, rest: Array, place: str, count: int = 1
) -> list[tuple[int, float]]:
    """Orders of a place's angle that explain most of the whitened rest, best first.

    Args:
        evidence: the confrontation and its noise.
        rest: whitened rows with the nuisances' share removed, shape (n,).
        place: motor_1, pinion_2, table, ...
        count: how many at most; neighbours of a better one are left out.

    Returns:
        (order, fall of chi^2), only those that stand out.

    """
    gains = np.zeros(HIGHEST + 1)
    c = evidence.confrontation
    parts = evidence.apart(rest)
    for k in range(len(parts)):
        angle = c.angle(k, place)
        if angle is None or np.ptp(angle) < 1e-9:
            continue
        white, own = evidence.whiteners[k], parts[k]
        for n in range(1, HIGHEST + 1):
            if n * float(np.ptp(angle)) < 2 * np.pi * _TURN or _too_fast(c.series[k].t, n * angle):
                continue
            columns = white(np.stack([np.cos(n * angle), np.sin(n * angle)], axis=1))
            gram = columns.T @ columns
            gram[np.diag_indices(2)] *= 1 + 1e-9
            pull = columns.T @ own
            gains[n] += float(pull @ np.linalg.solve(gram + 1e-300 * np.eye(2), pull))
    found: list[tuple[int, float]] = []
    for n in np.argsort(gains)[::-1]:
        if gains[n] < _STANDS_OUT or len(found) == count:
            break
        if all(abs(int(n) - m) > 1 for m, _ in found):
            found.append((int(n), float(gains[n])))
    return found


def _too_fast(t: Array, phase: Array) -> bool:
    """Whether the harmonic runs past half the sampling rate for most of the record."""
    return bool(np.median(np.abs(np.diff(phase))) > np.pi)


def members_of(machine: object, place: str) -> list[str]:
    """The single parts behind a place: motors -> motor_1, motor_2."""
    core = core_of(machine)
    if place in core.motors or place in core.bodies or place in core.connections:
        return [place]
    stem = {"motors": "motor", "pinions": "pinion", "meshes": "mesh"}.get(place, "")
    known = [*core.motors, *core.bodies, *core.connections]
    return [part for part in known if stem and part.startswith(f"{stem}_")] or [place]
