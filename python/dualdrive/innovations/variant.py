"""A machine with laws under trial, and what it leaves at a point of its unknowns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.estimation.unknowns import Unknown

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Variant:
    """A machine with effects under trial, and their unknowns.

    grown:   the core's machine with the effects in it
    effects: (effect, place); a group where every member has numbers of its own
    fixed:   parameter path -> value of what is counted, or held
    looks:   among how many values those were found
    """

    grown: Any
    extra: tuple[Unknown, ...] = ()
    effects: tuple[tuple[str, str], ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    looks: float = 1.0

    @property
    def label(self) -> str:
        """``coulomb@table``, two joined by `` + ``, or ``nothing``."""
        return " + ".join(f"{e}@{p}" for e, p in self.effects) or "nothing"

    @property
    def key(self) -> str:
        """What it holds, in whatever order: effects, and their numbers that are not free."""
        known = (f"{path.rpartition('.')[2]} {v:g}" for path, v in sorted(self.fixed.items()))
        numbers = ", ".join(dict.fromkeys(known))
        label = " + ".join(sorted(f"{e}@{p}" for e, p in self.effects)) or "nothing"
        return f"{label} ({numbers})" if numbers else label


@dataclass(frozen=True, eq=False)
class Point:
    """A variant at a point, shape (unknowns,), and its innovations there.

    residuals: whitened, records end to end, shape (rows, channels) each
    log_det:   sum of log det of the innovations' covariance
    lost:      a replay broke down
    """

    variant: Variant
    theta: Array
    residuals: tuple[Array, ...]
    log_det: float
    prior: float
    lost: bool = False

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened innovations."""
        return float(sum(np.einsum("ij,ij->", r, r) for r in self.residuals))

    @property
    def minus_two_log(self) -> float:
        """-2 log L, priors included, constants left out."""
        return self.chi2 + self.log_det + self.prior


def carried(point: Point, variant: Variant, otherwise: Array) -> Array:
    """Numbers of a variant as a point of another one has them, shape (unknowns,).

    Args:
        point: the other one.
        variant: whose numbers.
        otherwise: they, where the other one has none, shape (unknowns,).

    """
    shared = len(point.theta) - len(point.variant.extra)
    known = {p.path: u for p, u in zip(point.variant.extra, point.theta[shared:], strict=True)}
    own = zip(variant.extra, otherwise[shared:], strict=True)
    found: Array = np.r_[point.theta[:shared], [known.get(p.path, u) for p, u in own]]
    return found


def flat(residuals: Sequence[Array]) -> Array:
    """All rows end to end."""
    return np.concatenate([r.ravel() for r in residuals])
