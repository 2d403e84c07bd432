"""Scores without refitting: what a signature explains once all nuisances had their say.

Everything here is linear algebra on whitened rows. Nuisances (nominal numbers, constants of
sensors, initial states) are projected out within their priors, so that a drifted inertia cannot
pose as an effect, and a record is cut into blocks, each of which is foretold from the others.
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
    block: number of the block each row belongs to, (n,)
    pull:  (centre - u) / sigma of the nuisances, where they stand, (m,)
    sigma: their priors' widths, infinite where there is none, (m,)
    """

    left: Array
    slopes: Array
    block: NDArray[np.intp]
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
    held_out:  the same, every block foretold from the others
    error:     standard error of `held_out` from its scatter over the blocks
    strengths: of the columns, (k,)
    moved:     step of the nuisances beside them, (m,)
    """

    gain: float
    held_out: float
    error: float
    strengths: Array
    moved: Array


class Scorer:
    """Scores columns on rows whose nuisances stand at their best values, or near them."""

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        self.blocks = int(rows.block.max()) + 1
        own = [rows.block == b for b in range(self.blocks)]
        self._own = own
        parts = [(rows.slopes[k], rows.left[k]) for k in own]
        self._gram = np.stack([s.T @ s for s, _ in parts])
        self._pull = np.stack([s.T @ r for s, r in parts])
        self._square = np.array([r @ r for _, r in parts])
        prior = rows.precision
        self._prior = np.diag(prior)
        self._prior_pull = -np.where(prior > 0, rows.pull / rows.sigma, 0.0)
        self._before = self._alone()

    @property
    def alone(self) -> float:
        """chi^2 with the nuisances at their best, priors included, and no effect."""
        return self._before[0]

    def __call__(self, columns: Array) -> Gain:
        """Score columns of shape (n, k)."""
        width = columns.shape[1]
        if not np.any(columns):
            zero = np.zeros(width)
            return Gain(0.0, 0.0, 0.0, zero, np.zeros(self.rows.slopes.shape[1]))
        size = np.linalg.norm(columns, axis=0)
        size = np.where(size > 0, size, 1.0)
        scaled = columns / size
        parts = [scaled[k] for k in self._own]
        cross = np.stack([self.rows.slopes[k].T @ c for k, c in zip(self._own, parts, strict=True)])
        gram = np.stack([c.T @ c for c in parts])
        pull = np.stack([c.T @ self.rows.left[k] for k, c in zip(self._own, parts, strict=True)])
        whole = _joined(self._gram, cross, gram)
        right = np.concatenate([self._pull, pull], axis=1)
        belief = np.zeros((whole.shape[1], whole.shape[1]))
        m = len(self._prior)
        belief[:m, :m] = self._prior
        believed = np.concatenate([self._prior_pull, np.zeros(width)])
        chi, step, foretold = _solve(whole, right, self._square, belief, believed)
        before, _, foretold_before = self._before
        each = foretold_before - foretold
        error = float(np.sqrt(len(each)) * np.std(each, ddof=1)) if len(each) > 1 else 0.0
        return Gain(before - chi, float(each.sum()), error, step[m:] / size, step[:m])

    def whole(self, columns: Array) -> Gain:
        """The best single column of (n, k) at its full size: what has no strength to scale."""
        found = []
        for k, column in enumerate(columns.T):
            left = self.rows.left + column
            pull = np.stack([self.rows.slopes[own].T @ left[own] for own in self._own])
            square = np.array([left[own] @ left[own] for own in self._own])
            chi, step, foretold = _solve(self._gram, pull, square, self._prior, self._prior_pull)
            each = self._before[2] - foretold
            error = float(np.sqrt(len(each)) * np.std(each, ddof=1)) if len(each) > 1 else 0.0
            chosen = np.eye(columns.shape[1])[k]
            found.append(Gain(self._before[0] - chi, float(each.sum()), error, chosen, step))
        return max(found, key=lambda g: g.gain)

    def rest(self, columns: Array) -> Array:
        """What the nuisances can not imitate of columns (n, k), within their priors."""
        inverse = np.linalg.pinv(self._gram.sum(0) + self._prior, rcond=_RIDGE, hermitian=True)
        result: Array = columns - self.rows.slopes @ (inverse @ (self.rows.slopes.T @ columns))
        return result

    def _alone(self) -> tuple[float, Array, Array]:
        return _solve(self._gram, self._pull, self._square, self._prior, self._prior_pull)


def _joined(first: Array, cross: Array, last: Array) -> Array:
    """Normal matrices per block from their parts."""
    upper = np.concatenate([first, cross], axis=2)
    lower = np.concatenate([np.swapaxes(cross, 1, 2), last], axis=2)
    return np.concatenate([upper, lower], axis=1)


def _solve(
    gram: Array, pull: Array, square: Array, belief: Array, believed: Array
) -> tuple[float, Array, Array]:
    """chi^2 at the best step, that step, and chi^2 of every block at the step of the others."""
    whole, right = gram.sum(0) + belief, pull.sum(0) + believed
    step = -solved(whole, right)
    chi = float(square.sum() + 2 * step @ right + step @ whole @ step)
    foretold = np.empty(len(square))
    for b in range(len(square)):
        others = -solved(whole - gram[b], right - pull[b])
        foretold[b] = square[b] + 2 * others @ pull[b] + others @ gram[b] @ others
    return chi, step, foretold


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
