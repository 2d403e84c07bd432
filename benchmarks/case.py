"""The case that every engine runs: one closed loop with many impacts, and its exact solution.

Eleven states, mesh 1e8 N m/rad, 10 s of a sine, output every millisecond. The numbers are those of
`speed_study` in tests/py/reference_model.py, whose mode-wise exact solution is the truth here. The
error of a run is that of the worst of the eight states of Eq. 23, each over its own peak: reached,
not asked for.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "py"))

import reference_model as reference

Array = NDArray[np.float64]

VARIANT = "H"
SPAN = 10.0  # s
AMPLITUDE, FREQUENCY = 0.02, 0.5  # rad, Hz


def machine() -> reference.Machine:
    return reference.speed_study(VARIANT)


def motion() -> reference.Motion:
    return reference.sine(AMPLITUDE, FREQUENCY)


@cache
def truth() -> reference.Trajectory:
    return reference.simulate(machine(), motion(), SPAN)


@cache
def spread() -> float:
    """How far a shift of 1e-12 of the gap at the start carries: no two solvers can agree better."""
    return error_of(reference.simulate(machine(), motion(), SPAN, perturbation=1e-12).X)


def error_of(X: Array) -> float:
    """The worst state's largest error over its own peak; X is shape (times, 8), order of Eq. 23."""
    true = truth().X
    return float((np.abs(X - true).max(axis=0) / np.abs(true).max(axis=0)).max())


@dataclass(frozen=True)
class Point:
    """One engine at one tolerance.

    ms:     processor time per simulated second, best of the repeats
    error:  reached, see `error_of`; infinite where the engine gave up
    events: contacts made or lost that it located
    """

    engine: str
    rtol: float
    ms: float
    error: float
    events: int
    note: str = ""


@dataclass(frozen=True)
class Engine:
    """A way to run the case: `run(rtol)` returns (X, located contacts)."""

    name: str
    rtols: tuple[float, ...]
    run: Callable[[float], tuple[Array, int]] = field(repr=False)
    repeats: int = 3
    note: str = ""

    def measure(self, rtol: float) -> Point:
        best, X, events = np.inf, np.empty((0, 8)), 0
        for _ in range(self.repeats):
            begin = time.process_time()
            try:
                X, events = self.run(rtol)
            except RuntimeError as failure:
                return Point(self.name, rtol, np.nan, np.inf, 0, str(failure))
            best = min(best, time.process_time() - begin)
            if best > 2.0:  # s: long enough to be told from noise
                break
        return Point(self.name, rtol, 1e3 * best / SPAN, error_of(X), events, self.note)


def at_equal_error(points: list[Point], target: float) -> float | None:
    """Time at a reached error, ms: between the two nearest points on logarithmic axes.

    An engine whose coarsest run is better than asked for costs what that run costs; None where no
    run is good enough.
    """
    usable = sorted((p.error, p.ms) for p in points if np.isfinite(p.error))
    if not usable or usable[0][0] > target:
        return None
    errors, ms = (np.array(column) for column in zip(*usable, strict=True))
    if errors[-1] <= target:
        return float(ms[errors <= target].min())
    return float(np.exp(np.interp(np.log(target), np.log(errors), np.log(ms))))


def grid() -> Array:
    return np.asarray(truth().t)


def plain(value: Any) -> Any:
    """What JSON can say: no NaN, no infinity."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value
