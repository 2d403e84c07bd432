"""What a search works with and what it finds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from dualdrive.diagnose.screening import Scored
from dualdrive.innovations import GreyBox, Noise, Point, Variant


@dataclass(frozen=True)
class Effort:
    """How much is tried.

    refitted: laws refitted beside a base, best scores first
    finals:   of them, how many under a noise of their own
    most:     effects at once
    """

    refitted: int
    finals: int
    most: int


EFFORTS = {
    "quick": Effort(4, 2, 2),
    "normal": Effort(8, 4, 3),
    "thorough": Effort(20, 5, 3),
}


@dataclass(frozen=True, eq=False)
class Fitted:
    """A variant at its best, under the noise that it leaves itself.

    criterion: -2 log L over the inflation, plus the price of every number, plus what was searched
    told_under: the noise under which derivatives tell how sure its numbers are; None: its own. A
        simulation that bounces goes another way at the least change, and would seem sure of all
    """

    point: Point
    noise: Noise
    inflation: float
    criterion: float
    gains: Sequence[Any] = field(repr=False)
    told_under: Noise | None = None

    @property
    def variant(self) -> Variant:
        """What was fitted."""
        return self.point.variant


@dataclass(frozen=True, eq=False)
class Selection:
    """What a search found.

    grey:     all samples of the records
    base:     nothing but refitted numbers
    finals:   best first, `base` among them
    screened: every score test that was done, best gain first: (beside what, score)
    tried:    key -> gain of laws refitted under a base's noise, over the inflation
    finished: False: it was stopped
    quiet:    whether numbers alone leave noise, in a simulation, too
    """

    grey: GreyBox
    base: Fitted
    finals: Sequence[Fitted]
    screened: Sequence[tuple[str, Scored]]
    tried: dict[str, float]
    finished: bool
    quiet: bool

    @property
    def best(self) -> Fitted:
        """The leader."""
        return self.finals[0]
