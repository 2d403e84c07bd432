"""What tuning leaves: steps with their figures and pictures, and the machine as tuned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.display import Displayed
from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.run import Run
from dualdrive.tune.limits import MotionLimits
from dualdrive.units import human

__all__ = ["Assessment", "Curve", "Panel", "Status", "Step", "Tuning"]

Array = NDArray[np.float64]
_NOTHING = 1e-12  # SI: below it rounding speaks, not the machine
#: done; declined by who was asked; refused, which ends the procedure; not run, after that
Status = Literal["done", "declined", "refused", "not run"]


@dataclass(frozen=True, eq=False)
class Curve:
    """One line or set of points of a picture; x and y in the panel's units, shape (n,)."""

    label: str
    x: Array
    y: Array
    points: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """One diagram of a step.

    marks: places on the x axis with a word each
    names: of rows, where y counts them
    """

    title: str
    x: str
    y: str
    curves: tuple[Curve, ...]
    marks: tuple[tuple[float, str], ...] = ()
    log_x: bool = False
    names: tuple[str, ...] = ()
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Assessment:
    """The machine on the test move; SI.

    stable:   whether small vibrations die out while the table turns with all flanks closed
    growth:   largest real part of a pole then, 1/s
    frequency_hz: of that pole
    figures:  name -> value; empty where the test move can't be simulated to its end
    units:    of the figures
    run:      the simulated test move; None where it doesn't come to its end
    """

    stable: bool
    growth: float
    frequency_hz: float
    figures: Mapping[str, float]
    units: Mapping[str, str]
    run: Run | None = field(repr=False)

    def spoken(self, name: str) -> str:
        """A figure with its unit, or that there is none."""
        if name not in self.figures:
            return "no end"
        value = self.figures[name]
        unit = self.units[name]
        if abs(value) < _NOTHING:
            return "0 arcsec" if unit == "rad" else human(0.0, unit)
        return human(value, unit)

    @property
    def stability(self) -> str:
        """``yes``, or what grows and how fast."""
        return "yes" if self.stable else f"no: {self.growing}"

    @property
    def growing(self) -> str:
        """What grows in an unstable loop, and how fast."""
        what = f"{self.frequency_hz:.3g} Hz" if self.frequency_hz > 0.0 else "an error"
        return f"{what} grows by {self.growth:.3g} 1/s while the table turns"


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the procedure.

    number:   1 to 8, as in section 3.3 of the paper
    done:     what was done and found, one line each
    changes:  path -> (before, after), SI
    reason:   why the procedure ends here; empty where it goes on
    """

    number: int
    title: str
    done: tuple[str, ...]
    before: Assessment
    after: Assessment
    changes: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    panels: tuple[Panel, ...] = ()
    status: Status = "done"
    reason: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Tuning(Displayed, picture="tuning"):
    """The outcome.

    machine:  tuned as far as the procedure came; a changed copy
    status:   tuned; in part, as asked for; refused (step 3, say); or not done: it ended, and does
              not stand still or is unstable
    limits:   acceleration and jerk for the control; None where the test motion has none
    """

    machine: Machine
    steps: tuple[Step, ...]
    before: Assessment
    after: Assessment
    motion: Motion
    limits: MotionLimits | None
    status: Literal["tuned", "in part", "refused", "not done"]
    reason: str

    def rows(self) -> list[tuple[str, str, str]]:
        """Figure, before, after, with units."""
        names = self.after.figures or self.before.figures
        rows = [(n, self.before.spoken(n), self.after.spoken(n)) for n in names]
        return [*rows, ("stable", self.before.stability, self.after.stability)]

    def figures(self) -> dict[str, Any]:
        """Plain numbers for JSON, SI."""
        return {
            "machine": self.machine.name,
            "motion": self.motion.text,
            "status": self.status,
            "reason": self.reason,
            "units": dict(self.after.units or self.before.units),
            "before": _plain(self.before),
            "after": _plain(self.after),
            "limits": None if self.limits is None else vars(self.limits),
            "steps": [
                {
                    "number": step.number,
                    "title": step.title,
                    "status": step.status,
                    "done": list(step.done),
                    "reason": step.reason,
                    "changes": {k: {"before": a, "after": b} for k, (a, b) in step.changes.items()},
                    "before": _plain(step.before),
                    "after": _plain(step.after),
                    **step.details,
                }
                for step in self.steps
            ],
        }


def _plain(found: Assessment) -> dict[str, Any]:
    return {
        "stable": found.stable,
        "growth": found.growth,
        "frequency_hz": found.frequency_hz,
        "figures": dict(found.figures),
    }
