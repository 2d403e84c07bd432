"""Scores without refitting: what a signature explains once all nuisances had their say.

Everything here is linear algebra on whitened rows. Nuisances (nominal numbers, zeros of encoders,
constant torques) are projected out within their priors, so that a drifted inertia cannot pose as an
effect.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.algebra import solved

Array = NDArray[np.float64]

_RIDGE = 1e-10  # of the largest curvature: what no row sees stays put


@dataclass(frozen=True, eq=False)
class Rows:
    """Whitened rows of all series, end to end.

    left:  what the machine leaves, (n,)
    slopes: of the nuisances, (n, m)
    pull:  (centre - u) / sigma of the nuisances, where they stand, (m,)
    sigma: their priors' widths, infinite where there is none, (m,)
    """

    left: Array
    slopes: Array
    pull: Array
    sigma: Array

    @property
    def precision(self) -> Array:
        """1 / sigma^2, zero where nothing is believed, (m,)."""
        return np.where(np.isfinite(self.sigma), 1.0 / self.sigma**2, 0.0)

    def beside(self, columns: Array) -> Rows:
        """The same with more nuisances, of which nothing is believed: columns of shape (n, k)."""
        width = columns.shape[1]
        return replace(
            self,
            slopes=np.concatenate([self.slopes, columns], axis=1),
            pull=np.concatenate([self.pull, np.zeros(width)]),
            sigma=np.concatenate([self.sigma, np.full(width, np.inf)]),
        )


@dataclass(frozen=True, eq=False)
class Gain:
    """What columns gain over none.

    gain:      fall of chi^2, nuisances free to move within their priors in both
    strengths: of the columns, (k,)
    moved:     step of the nuisances beside them, (m,)
    """

    gain: float
    strengths: Array
    moved: Array


class Scorer:
    """Scores columns on rows whose nuisances stand at their best values, or near them."""

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        prior = rows.precision
        self._gram = rows.slopes.T @ rows.slopes + np.diag(prior)
        self._right = rows.slopes.T @ rows.left - np.where(prior > 0, rows.pull / rows.sigma, 0.0)
        self._fall, _ = _solve(self._gram, self._right)

    def __call__(self, columns: Array) -> Gain:
        """Score columns of shape (n, k)."""
        m = len(self._right)
        if not np.any(columns):
            return Gain(0.0, np.zeros(columns.shape[1]), np.zeros(m))
        size = np.linalg.norm(columns, axis=0)
        size = np.where(size > 0, size, 1.0)
        scaled = columns / size
        cross = self.rows.slopes.T @ scaled
        gram = np.block([[self._gram, cross], [cross.T, scaled.T @ scaled]])
        fall, step = _solve(gram, np.concatenate([self._right, scaled.T @ self.rows.left]))
        return Gain(fall - self._fall, step[m:] / size, step[:m])

    def rest(self, columns: Array) -> Array:
        """What the nuisances can not imitate of columns (n, k), within their priors."""
        inverse = np.linalg.pinv(self._gram, rcond=_RIDGE, hermitian=True)
        result: Array = columns - self.rows.slopes @ (inverse @ (self.rows.slopes.T @ columns))
        return result


def _solve(gram: Array, right: Array) -> tuple[float, Array]:
    """By how much chi^2 falls at the best step, and that step."""
    step = -solved(gram, right)
    return -float(2 * step @ right + step @ gram @ step), step


def alike(first: Array, second: Array) -> float:
    """Largest squared cosine between the spans of two sets of columns, 0 .. 1.

    For sets of different width: how much of the smaller the larger can imitate, at the least.
    """
    a, b = _basis(first), _basis(second)
    if not a.shape[1] or not b.shape[1]:
        return 0.0
    values = np.linalg.svd(a.T @ b, compute_uv=False)
    return float(values.min() ** 2)


def _basis(columns: Array) -> Array:
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > 1e-8 * s[0]] if len(s) and s[0] > 0 else u[:, :0]
