"""Order analysis of white innovations: which multiples of a part's angle they carry.

Under a right model whitened innovations are white, so that a periodogram over an angle is
chi-squared with two degrees of freedom a channel at every order (Brandt, Noise and Vibration
Analysis, ch. 12).
A ripple that grows with the current, or a friction that turns with the speed, is carried by that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.orders import HIGHEST, angle_of
from dualdrive.innovations import Point, Predictable

Array = NDArray[np.float64]

_TURN = 0.5  # periods that a record must hold for an order to be seen at all


def strongest_orders(
    core: object,
    records: Sequence[Predictable],
    point: Point,
    place: str,
    carrier: str,
    count: int,
) -> list[int]:
    """Orders of a place's angle that the innovations carry most, best first.

    Args:
        core: the machine.
        records: what was measured.
        point: what the machine leaves of them.
        place: whose angle it is.
        carrier: of the harmonics, as the law declares it.
        count: how many at most.

    """
    power = np.zeros(HIGHEST + 1)
    for r, left in zip(records, point.residuals, strict=True):
        columns = {name: np.asarray(r.record.trace[name]) for name in r.record.trace}
        angle = angle_of(core, columns, place)
        if angle is None:
            continue
        cosine, sine = np.cos(angle), np.sin(angle)
        real = _carrier(columns, place, carrier, r.record.reference)
        imaginary = np.zeros(len(angle))
        travel = float(np.ptp(angle))
        fastest = float(np.median(np.abs(np.diff(angle))))
        for n in range(1, HIGHEST + 1):
            real, imaginary = real * cosine - imaginary * sine, imaginary * cosine + real * sine
            if n * travel < 2 * np.pi * _TURN or n * fastest > np.pi:
                continue
            along = np.sum((real @ left) ** 2 + (imaginary @ left) ** 2)
            power[n] += 2.0 * float(along) / len(angle)
    return [int(n) for n in np.argsort(-power, kind="stable")[:count] if power[n] > 0.0]


def _carrier(columns: dict[str, Array], place: str, carrier: str, reference: Array) -> Array:
    """What the harmonics are multiplied by, RMS 1, shape (n,)."""
    if carrier == "direction":
        return np.sign(np.gradient(reference))
    number = place.rpartition("_")[2]
    for name in (f"T_{number}", f"I_{number}", "T_1", "I_1"):
        if carrier == "torque" and name in columns:
            return columns[name] / (float(np.sqrt(np.mean(columns[name] ** 2))) + 1e-300)
    return np.ones(len(reference))
