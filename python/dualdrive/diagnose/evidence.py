"""Records as whitened rows in blocks: the form in which all hypotheses are judged alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.score import Rows
from dualdrive.diagnose.whitening import Whitener, count_as_one

Array = NDArray[np.float64]

BLOCKS = 12  # over all records; fewer where they are short
_SHORTEST = 40  # samples of a block


@dataclass(frozen=True, eq=False)
class Evidence:
    """A confrontation under one description of its noise."""

    confrontation: TorqueBalance
    whiteners: Sequence[Whitener]
    block: NDArray[np.intp]

    def white(self, parts: Sequence[Array]) -> Array:
        """Rows of all series, end to end, from one array of shape (n,) or (n, k) per series."""
        return np.concatenate([w(p) for w, p in zip(self.whiteners, parts, strict=True)])

    def apart(self, rows: Array) -> list[Array]:
        """The inverse of joining: rows per series."""
        ends = np.cumsum([len(s.t) for s in self.confrontation.series])
        return np.split(rows, ends[:-1])

    def rows(self, u: Array, left: Sequence[Array], slopes: Sequence[Array]) -> Rows:
        """Rows for the scorer with the nuisances at u."""
        c = self.confrontation
        sigma = np.where(c.sigma > 0, c.sigma, np.inf)
        pull = np.where(np.isfinite(sigma), (c.centre - u) / sigma, 0.0)
        return Rows(self.white(left), self.white(slopes), pull, sigma)

    def chi(self, u: Array, left: Sequence[Array]) -> float:
        """chi^2 of the rows, and of the nuisances against their priors."""
        c = self.confrontation
        believed = np.isfinite(c.sigma)
        off = ((u - c.centre)[believed] / c.sigma[believed]) if believed.any() else np.zeros(0)
        rows = self.white(left)
        return float(rows @ rows + off @ off)

    @property
    def count(self) -> int:
        """Independent rows, as far as the whiteners know."""
        return int(sum(w.keep.sum() / w.alike for w in self.whiteners))


def evidence(confrontation: TorqueBalance, whiteners: Sequence[Whitener]) -> Evidence:
    """Rows in blocks: stretches of time of each record, the same for all of its series."""
    series = confrontation.series
    lengths = {s.record: len(s.t) for s in series}
    whole = sum(lengths.values())
    first, blocks = 0, {}
    for record, length in lengths.items():
        count = max(1, min(round(BLOCKS * length / whole), length // _SHORTEST))
        blocks[record] = first + np.minimum(np.arange(length) * count // length, count - 1)
        first += count
    return Evidence(
        confrontation, list(whiteners), np.concatenate([blocks[s.record] for s in series])
    )


def effective(rows: Array, evidence: Evidence) -> float:
    """By how much what is left, though whitened, still counts itself twice: 1 or more.

    chi^2 per row (an overdispersion where the noise is larger than it seemed), times how many rows
    count as one beyond what the whiteners know of it.
    """
    rows_of, squares = [], []
    for part, whitener in zip(evidence.apart(rows), evidence.whiteners, strict=True):
        own = part[whitener.keep]
        squares.append(whitener.alike * float(own @ own))
        rows_of.append(count_as_one(own) / whitener.alike)
    over = sum(squares) / max(sum(int(w.keep.sum()) for w in evidence.whiteners), 1)
    alike = float(np.average(rows_of, weights=np.array(squares) + 1e-300))
    return max(1.0, over) * max(1.0, alike)


def alike(seen: Evidence, left: Sequence[Array]) -> list[tuple[int, int, float]]:
    """(j, k, correlation of the white rows) of all series j and k of one record, both ways round.

    They share noise: an encoder is in the sum at the table and in the equation of its drive.

    left: what a hypothesis leaves, per series (n,)
    """
    series, rows = seen.confrontation.series, seen.apart(seen.white(left))
    return [
        (j, k, _correlation(rows[j], rows[k]) if j != k else 1.0)
        for j, one in enumerate(series)
        for k, other in enumerate(series)
        if one.record == other.record
    ]


def _correlation(first: Array, second: Array) -> float:
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size > 0.0 else 0.0


def shared_curvature(
    seen: Evidence, known: Sequence[tuple[int, int, float]], columns: Array
) -> Array:
    """Covariance of the gradient along white columns (n, k) where series share noise, (k, k).

    known: of `alike`. Where no two series are alike it is the curvature, columns.T @ columns.
    """
    parts = seen.apart(columns)
    none = np.zeros((columns.shape[1], columns.shape[1]))
    return np.asarray(sum((r * parts[j].T @ parts[k] for j, k, r in known), none), float)
