"""What a torque balance is drawn up with: its series, and what is believed of nominal numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.estimation.unknowns import Unknown, default_free, default_tolerances, unknowns

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: one-sigma of an asymmetry of friction: without it a refit trades friction one way for drag
ASYMMETRY = 0.2
_FARTHEST = 20.0  # standard deviations of a belief
#: relative one-sigma tolerance of nominal numbers, for all or by path; the usual ones where None
Tolerance = float | Mapping[str, float] | None


def nominal_unknowns(core: Any, paths: Sequence[str], tolerance: Tolerance) -> list[Unknown]:
    """Nominal numbers as unknowns, those whose tolerance is given with it.

    Raises:
        ValueError: a tolerance for a number that is not among them.

    """
    if not isinstance(tolerance, Mapping):
        return _believed(unknowns(core, list(paths), tolerance, {}) if paths else [])
    if stray := set(tolerance) - set(default_free(core)):
        raise ValueError(
            f"tolerance: {', '.join(sorted(stray))} is not refitted here; "
            f"there are {', '.join(paths)}"
        )
    own = {path: tolerance[path] for path in paths if path in tolerance}
    usual = {**default_tolerances(core, paths), **own}
    return _believed(unknowns(core, list(paths), usual, {}) if paths else [])


def believable(low: Array, high: Array, centre: Array, sigma: Array) -> tuple[Array, Array]:
    """Bounds no further from what is believed than any record could say, each (m,).

    A step along what no row sees would end where numbers overflow.
    """
    reach = np.where(np.isfinite(sigma), _FARTHEST * sigma, np.inf)
    return np.maximum(low, centre - reach), np.minimum(high, centre + reach)


def _believed(nominal: Sequence[Unknown]) -> list[Unknown]:
    """The same, friction believed to be much alike both ways where nothing else is said of it."""
    return [
        replace(p, sigma=ASYMMETRY / p.scale)
        if p.path.endswith(".asymmetry") and not math.isfinite(p.sigma)
        else p
        for p in nominal
    ]


@dataclass(frozen=True, eq=False)
class Series:
    """One equation of motion on one record; arrays of shape (n,), SI.

    measured: torque, N*m
    floor: RMS that the sensors alone leave, an estimate from the record
    rate:  how fast the motion is: what a jittering clock multiplies
    keep:  samples that count
    """

    record: str
    name: str
    t: Array
    measured: Array
    floor: float
    rate: Array
    keep: Flags

    @property
    def spread(self) -> float:
        """RMS of the measured values about their mean."""
        own = self.measured[self.keep]
        return float(np.std(own)) if len(own) else 0.0
