"""Accuracy and repeatability of positioning: the figures of ISO 230-2 (GB/T 17421.2).

    x_ij = P_ij - P_i                           deviation at target i, approach j
    mean x_i(up), s_i(up), the same down        s with n - 1
    B_i = mean up - mean down,  B = max |B_i|   reversal error
    R_i(up) = 4 s_i(up),  R = max R_i           repeatability
    R_i = max(2 s_i(up) + 2 s_i(down) + |B_i|, R_i(up), R_i(down))
    M = max - min of (mean up + mean down) / 2  mean bidirectional error
    E = max - min of all means                  systematic error
    A = max(mean + 2 s) - min(mean - 2 s)       accuracy, over both directions

Source: ISO 230-2:2014, clause 3. One-sided figures take one direction alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.display import Displayed

from .rules import IndexingError, evaluated_once, remarks

__all__ = ["FIGURES", "Iso230", "TargetRow", "evaluate"]

Floats = NDArray[np.float64]

#: figure -> what it is; the order in which they are shown
FIGURES: dict[str, str] = {
    "A": "bidirectional accuracy",
    "A_up": "unidirectional accuracy, upwards",
    "A_down": "unidirectional accuracy, downwards",
    "R": "bidirectional repeatability",
    "R_up": "unidirectional repeatability, upwards",
    "R_down": "unidirectional repeatability, downwards",
    "E": "bidirectional systematic error",
    "E_up": "unidirectional systematic error, upwards",
    "E_down": "unidirectional systematic error, downwards",
    "M": "mean bidirectional error",
    "B": "reversal error",
    "B_mean": "mean reversal error",
}


@dataclass(frozen=True)
class TargetRow:
    """One target: means, reversal error, spreads. None where the test does not give a number."""

    target: float
    mean_up: float
    mean_down: float | None
    mean: float | None
    B: float | None
    s_up: float | None
    s_down: float | None
    R_up: float | None
    R_down: float | None
    R: float | None


@dataclass(frozen=True, eq=False)
class Iso230(Displayed, picture="indexing"):
    """A test as evaluated.

    targets:  shape (m,), increasing;  up, down: deviations x_ij, shape (m, n), `down` None where
              the targets were approached from below only
    unit:     of all of them: rad, m, or "" where it is not known
    travel:   over which the axis was tested
    name:     of the machine or file;  notes: what was noted on the way, and what the standard asks

    Figures are attributes (``result.A``), in `unit`; None where the test does not give them.
    """

    targets: Floats
    up: Floats
    down: Floats | None
    unit: str
    travel: float
    name: str = ""
    notes: tuple[str, ...] = ()

    @property
    def repeats(self) -> int:
        """Approaches of every target from each side."""
        return int(self.up.shape[1])

    @property
    def spread_known(self) -> bool:
        """Whether s, R and A are evaluated."""
        return self.repeats > 1 and not evaluated_once(self.unit, self.travel)

    def sides(self) -> list[Floats]:
        """The deviations of each side that was approached from."""
        return [self.up] if self.down is None else [self.up, self.down]

    def spread(self, deviations: Floats) -> Floats | None:
        """s_i of one side, shape (m,)."""
        return deviations.std(axis=1, ddof=1) if self.spread_known else None

    @property
    def rows(self) -> list[TargetRow]:
        """One row per target."""
        return [self._row(i) for i in range(self.targets.size)]

    def _row(self, i: int) -> TargetRow:
        spreads = [self.spread(side) for side in self.sides()]
        s_up, s_down = ([None if s is None else float(s[i]) for s in spreads] + [None])[:2]
        mean_up = float(self.up[i].mean())
        mean_down = None if self.down is None else float(self.down[i].mean())
        reversal = None if mean_down is None else mean_up - mean_down
        both = None
        if reversal is not None and s_up is not None and s_down is not None:
            both = max(2 * s_up + 2 * s_down + abs(reversal), 4 * s_up, 4 * s_down)
        return TargetRow(
            target=float(self.targets[i]),
            mean_up=mean_up,
            mean_down=mean_down,
            mean=None if mean_down is None else (mean_up + mean_down) / 2,
            B=reversal,
            s_up=s_up,
            s_down=s_down,
            R_up=None if s_up is None else 4 * s_up,
            R_down=None if s_down is None else 4 * s_down,
            R=both,
        )

    def __getattr__(self, name: str) -> float | None:
        """A figure by its letter."""
        if name in FIGURES:
            return self.figures()[name]
        raise AttributeError(f"Iso230 has no {name!r}; its figures are {', '.join(FIGURES)}")

    def figures(self) -> dict[str, float | None]:
        """Every figure by its letter, None where the test does not give it."""
        found: dict[str, float | None] = dict.fromkeys(FIGURES)
        sides = {"up": self.up} | ({} if self.down is None else {"down": self.down})
        for way, side in sides.items():
            found[f"E_{way}"] = self._systematic(side)
            found[f"A_{way}"] = self._accuracy(side)
            spread = self.spread(side)
            found[f"R_{way}"] = None if spread is None else float(4 * spread.max())
        if self.down is None:
            return found
        reversal = self.up.mean(axis=1) - self.down.mean(axis=1)
        found["B"] = float(np.abs(reversal).max())
        found["B_mean"] = float(reversal.mean())
        found["M"] = float(np.ptp((self.up.mean(axis=1) + self.down.mean(axis=1)) / 2))
        found["E"] = self._systematic(self.up, self.down)
        found["A"] = self._accuracy(self.up, self.down)
        each = [row.R for row in self.rows]
        found["R"] = max(r for r in each if r is not None) if self.spread_known else None
        return found

    def _systematic(self, *sides: Floats) -> float:
        return float(np.ptp([side.mean(axis=1) for side in sides]))

    def _accuracy(self, *sides: Floats) -> float | None:
        means = np.array([side.mean(axis=1) for side in sides])
        spreads = [self.spread(side) for side in sides]
        if any(s is None for s in spreads):
            return None
        twice = 2 * np.array(spreads, float)
        return float((means + twice).max() - (means - twice).min())

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, in `unit`."""
        return {
            "name": self.name,
            "unit": self.unit,
            "travel": self.travel,
            "repeats": self.repeats,
            "figures": self.figures(),
            "targets": [vars(row) for row in self.rows],
            "deviations": {
                "up": self.up.tolist(),
                "down": None if self.down is None else self.down.tolist(),
            },
            "notes": list(self.notes),
        }


def evaluate(
    targets: ArrayLike,
    positions_up: ArrayLike | Sequence[Sequence[float]],
    positions_down: ArrayLike | Sequence[Sequence[float]] | None = None,
    *,
    unit: str = "rad",
    travel: float | None = None,
    name: str = "",
    notes: Sequence[str] = (),
) -> Iso230:
    """Evaluate a positioning test after ISO 230-2.

    targets:         shape (m,), increasing, in `unit`
    positions_up:    where the axis stood when it came from below, shape (m, n), in `unit`
    positions_down:  the same from above; without it one-sided figures alone are given
    unit:            rad or m, by which the standard's counts of targets go; "" knows none
    travel:          over which the axis is tested; else from the first target to the last

    What the standard asks and the test lacks is in `notes`; a figure that the test does not give
    (R of one approach, B of one side) is None. Raises IndexingError where targets repeat, counts
    differ between targets or sides, or a number is not finite.
    """
    places = np.array(targets, float).reshape(-1)
    if not places.size or not np.isfinite(places).all() or (np.diff(places) <= 0).any():
        raise IndexingError(
            f"{_of(name)}targets {places.tolist()}: must be finite and increasing; sort them, "
            "and give every target once"
        )
    up = _deviations(places, positions_up, "upwards", name)
    down = (
        None if positions_down is None else _deviations(places, positions_down, "downwards", name)
    )
    if down is not None and down.shape != up.shape:
        raise IndexingError(
            f"{_of(name)}{up.shape[1]} approaches upwards, {down.shape[1]} downwards: counts must "
            "agree; leave out the cycles that are not whole"
        )
    length = float(np.ptp(places)) if travel is None else travel
    said = [*notes, *remarks(unit, length, places.size, up.shape[1])]
    if down is None:
        said.append("approached from below only: no B, M, R, E and A of both directions")
    return Iso230(places, up, down, unit, length, name, tuple(said))


def _of(name: str) -> str:
    return f"{name}: " if name else ""


def _deviations(targets: Floats, positions: Any, way: str, name: str) -> Floats:
    """x_ij = P_ij - P_i, checked."""
    rows = [np.atleast_1d(np.array(row, float)) for row in positions]
    if len(rows) != targets.size:
        raise IndexingError(
            f"{_of(name)}{targets.size} targets, {len(rows)} rows of positions {way}: give one row "
            "per target"
        )
    counts = [row.size for row in rows]
    if len(set(counts)) > 1 or not counts[0]:
        odd = next((k for k, c in enumerate(counts) if c != max(counts)), 0)
        raise IndexingError(
            f"{_of(name)}target {targets[odd]:g}: {counts[odd]} approaches {way}, others "
            f"{max(counts)}: counts must agree; measure what lacks or leave out the cycle"
        )
    table = np.array(rows)
    if not np.isfinite(table).all():
        i, j = np.argwhere(~np.isfinite(table))[0]
        raise IndexingError(
            f"{_of(name)}target {targets[i]:g}, approach {j + 1} {way}: {table[i, j]} is no "
            "position; measure it again or leave out the cycle"
        )
    deviations: Floats = table - targets[:, None]
    return deviations
