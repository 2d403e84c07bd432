"""A machine confronted with records: what it leaves, and how that moves with what is not known.

Two ways, one face. In the closed loop (`loop.py`) a series is a channel of a record, and what is
left is simulated minus measured. In the torque balance (`equations.py`) a series is an equation of
motion on the recorded motion. All that follows (noise, scores, refits, verdict) knows only this.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

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
    paths = [path for path in paths if not _no_delay(core, path)]
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


def _no_delay(core: Any, path: str) -> bool:
    """Whether it is a delay of the command that there is none of: the other one was found."""
    part = core.parameter(core.members(path)[0])
    return "@controller" in path and part.unit == "s" and float(core.get(path)) == 0.0


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


class Confrontation(Protocol):
    """A machine and records.

    core:    the core's machine, its nominal numbers as they stand
    nominal: the machine's numbers that are refitted under every hypothesis
    centre, sigma: of the prior of all nuisances: nominal numbers, then constants of sensors and
        initial states of each record; shape (m,)
    start:   where a refit begins, shape (m,)
    """

    core: Any
    nominal: list[Unknown]
    series: list[Series]
    start: Array
    centre: Array
    sigma: Array
    low: Array
    high: Array

    def left(self, core: Any, u: Array) -> list[Array] | None:
        """What `core`, its nominal numbers moved to u, leaves: per series (n,); None if it fails.

        `core` may carry effects that the confrontation's own machine lacks.
        """

    def slopes(self, core: Any, u: Array) -> list[Array] | None:
        """Derivative of the same by the nuisances: per series (n, m)."""

    def levelled(self, core: Any, u: Array) -> Array:
        """The point with every constant where the mean of what it moves vanishes."""

    def machine_at(self, core: Any, u: Array) -> Any:
        """The core's machine with the nominal numbers of u."""

    @property
    def one_clock(self) -> bool:
        """Whether no two angles can be held against each other, so that no delay has a witness."""

    @property
    def channels(self) -> list[str]:
        """Recorded channels that a recorder may have spoilt (read late, rounded, ...)."""

    def headline(self, left: Sequence[Array]) -> float:
        """Relative error as `compare` has it: kinds of channel averaged."""

    def columns(self, k: int) -> Mapping[str, Array]:
        """Recorded signals at the samples of series k, name -> (n,), SI."""

    def sizes(self) -> dict[str, float]:
        """Usual sizes at the table: ``torque`` N*m, ``speed`` rad/s, ``travel`` rad.

        Where they are known, too: ``current`` A of a motor; ``delay`` s, the shortest that is
        worth its simulation.
        """
