"""Pitch errors of a gear by its grade, and a wheel that has them.

ISO 1328-1:2013 (second edition), formulas 5 and 6 in 5.3.1 and 5.3.2, before rounding by 5.2.3:

    f_p = (0.001 d + 0.4 m + 5) sqrt(2)^(A - 5) um                     single pitch
    F_p = (0.002 d + 0.55 sqrt(d) + 0.7 m + 12) sqrt(2)^(A - 5) um     total cumulative pitch

with reference diameter d and normal module m in mm and grade (flank tolerance class) A from 1 to
11. The first edition, of 1995, had other formulas and took d and m by steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from dualdrive.indexing.rules import IndexingError
from dualdrive.machine import Machine

__all__ = ["Gear", "add_pitch_errors", "cumulative_pitch", "single_pitch"]

_UM: Final = 1e-6
_HARMONICS: Final = 4


@dataclass(frozen=True)
class Gear:
    """A wheel: pitch radius and normal module, m, and its grade.

    Raises IndexingError outside the standard's ranges.
    """

    radius: float
    module: float
    grade: float

    def __post_init__(self) -> None:
        ranges = (
            ("grade", self.grade, 1.0, 11.0, ""),
            ("diameter", 2e3 * self.radius, 5.0, 15000.0, " mm"),
            ("module", 1e3 * self.module, 0.5, 70.0, " mm"),
            ("teeth", self.teeth, 5.0, 1000.0, ""),
        )
        for name, value, low, high, unit in ranges:
            if not low <= value <= high:
                raise IndexingError(
                    f"{name} = {value:g}{unit}: ISO 1328-1:2013 goes from {low:g} to {high:g}{unit}"
                )

    @property
    def teeth(self) -> float:
        """Pitch circle over pitch."""
        return 2.0 * self.radius / self.module


def cumulative_pitch(gear: Gear) -> float:
    """Tolerance of the total cumulative pitch deviation F_p, m."""
    d, m = 2e3 * gear.radius, 1e3 * gear.module
    return _UM * (0.002 * d + 0.55 * math.sqrt(d) + 0.7 * m + 12.0) * _step(gear)


def single_pitch(gear: Gear) -> float:
    """Tolerance of the single pitch deviation f_p, m."""
    d, m = 2e3 * gear.radius, 1e3 * gear.module
    return _UM * (0.001 * d + 0.4 * m + 5.0) * _step(gear)


def _step(gear: Gear) -> float:
    return math.exp2((gear.grade - 5.0) / 2.0)


def add_pitch_errors(
    machine: Machine,
    place: str,
    gear: Gear,
    pinion_radius: float,
    random: np.random.Generator,
    *,
    spacing: float = 0.0,
    teeth: bool = False,
) -> None:
    """Give a wheel the pitch errors of its grade, as harmonics of drawn phases.

    place:         table (for the ring) or a pinion
    pinion_radius: pitch radius, m, at which a deviation becomes an angle of the pinion
    random:        draws the phases; as many numbers whatever the grade
    spacing:       of the ring: from each mesh to the next, rad
    teeth:         f_p at the tooth order besides

    Harmonics 1 to 4 have amplitudes that fall as 1/k and span F_p together.
    """
    orders = np.arange(1, _HARMONICS + 1)
    phases = random.uniform(0.0, math.tau, _HARMONICS + 1)
    turn = np.linspace(0.0, math.tau, 720, endpoint=False)
    shape = np.cos(np.outer(turn, orders) + phases[:-1]) / orders
    size = cumulative_pitch(gear) / float(np.ptp(shape.sum(axis=1))) / pinion_radius
    for order, phase in zip(orders.tolist(), phases[:-1].tolist(), strict=True):
        numbers = {"amplitude": size / order, "order": order, "phase": phase, "spacing": spacing}
        machine.add("pitch_error", place, **numbers)
    if teeth:
        amplitude = single_pitch(gear) / 2.0 / pinion_radius
        numbers = {"amplitude": amplitude, "teeth": gear.teeth, "phase": float(phases[-1])}
        machine.add("transmission_error", place, **numbers)
