"""What came out of the crossed experiment, by the rules that ADR 10 wrote down before it ran."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.indexing.experiment import PAIR, Cell, Crossed
from dualdrive.indexing.printed import PRINTED, printed_gain

__all__ = ["Spread", "Verdict", "rows", "verdicts"]

Floats = NDArray[np.float64]

_BETTER: Final = 0.9  # of the draws
_HALF: Final = 0.5  # of the printed improvement
_WHOLE: Final = 0.5  # arcsec: the paper prints whole ones


@dataclass(frozen=True)
class Spread:
    """A figure over the draws, arcsec; None where no draw has a reading."""

    least: float | None
    median: float | None
    most: float | None
    draws: int

    @classmethod
    def of(cls, values: Floats) -> Spread:
        """Of values of which some may be NaN."""
        known = values[~np.isnan(values)]
        if not known.size:
            return cls(None, None, None, 0)
        least, median, most = (float(x) for x in np.quantile(known, (0.0, 0.5, 1.0)))
        return cls(least, median, most, int(known.size))

    def holds(self, printed: float) -> bool:
        """Whether a printed whole number lies within the range of the draws."""
        if self.least is None or self.most is None:
            return False
        return self.least - _WHOLE <= printed <= self.most + _WHOLE

    @property
    def text(self) -> str:
        """``3.4 (2.1 to 6.0)``."""
        if self.median is None:
            return "no reading"
        return f"{self.median:.1f} ({self.least:.1f} to {self.most:.1f})"


@dataclass(frozen=True)
class Verdict:
    """One printed pair in one cell.

    old, new:  traditional and double motors;  gain: median over the draws, as a share
    better:    share of the draws in which two motors are better
    contrast:  it comes out;  levels: the printed numbers lie in the range, old and new
    """

    cell: Cell
    figure: str
    old: Spread
    new: Spread
    gain: float | None
    better: float
    contrast: bool
    levels: tuple[bool, bool]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        pair = {"traditional": vars(self.old), "double motors": vars(self.new)}
        rest = {k: getattr(self, k) for k in ("figure", "gain", "better", "contrast")}
        return {**vars(self.cell), **pair, **rest, "levels": list(self.levels)}


def verdicts(result: Crossed) -> Iterator[Verdict]:
    """Every printed pair in every cell."""
    for cell in result.cells():
        for figure in PRINTED[cell.load, "traditional"]:
            yield _judged(result, cell, figure)


def _judged(result: Crossed, cell: Cell, figure: str) -> Verdict:
    old, new = (result.values(cell, column, figure) for column in PAIR)
    both = ~(np.isnan(old) | np.isnan(new))
    gains = 1.0 - new[both] / old[both]
    gain = float(np.median(gains)) if both.any() else None
    better = float(np.mean(gains > 0.0)) if both.any() else 0.0
    wanted = _HALF * printed_gain(cell.load, figure)
    spreads = Spread.of(old), Spread.of(new)
    printed = [PRINTED[cell.load, column][figure] for column in PAIR]
    return Verdict(
        cell,
        figure,
        *spreads,
        gain,
        better,
        contrast=gain is not None and better >= _BETTER and gain >= wanted,
        levels=(spreads[0].holds(printed[0]), spreads[1].holds(printed[1])),
    )


def rows(result: Crossed) -> list[dict[str, Any]]:
    """Every cell of either column, printed or not: spreads of A, R and B, and how it was read."""
    return [
        {
            **vars(cell),
            "column": column,
            **{f: vars(Spread.of(result.values(cell, column, f))) for f in "ARB"},
            "unread": result.unread(cell, column),
            "moved": result.moved[cell, column],
        }
        for cell, column in result.figures
    ]
