"""Weighted linear least squares whose intervals survive coloured residuals.

Neighbouring residuals of a torque balance are alike (a wrong friction law is wrong for seconds), so
the textbook covariance is far too optimistic. Two remedies: a record counts with its *effective*
number of samples when it is weighed against priors, and the covariance is the sandwich
``H^-1 S H^-1`` with a long-run covariance ``S`` of the scores.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.coloured import (
    correlation_time,
    scatter_if_stationary,
    scatter_of_scores,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: singular values below this share of the largest (columns scaled alike) count as zero
RANK = 1e-6


@dataclass(frozen=True)
class Rows:
    """One record: what its equations leave and how that moves with the unknowns.

    Shapes: ``residual`` and ``measured`` (equations, n), ``jacobian`` (equations, n, unknowns),
    ``keep`` (equations, n). Samples of the equations belong to the same instants.
    """

    residual: Array
    jacobian: Array
    measured: Array
    keep: Flags

    def after(self, step: Array) -> Array:
        """What the equations leave once the unknowns have moved, (equations, n), 0 if not kept."""
        return np.where(self.keep, self.residual + self.jacobian @ step, 0.0)

    def weights(self, left: Array) -> tuple[Array, Array]:
        """Per equation: 1 / variance of what is left, and the effective number of its samples."""
        count = self.keep.sum(axis=1)
        sigma2 = np.where(count > 0, (left**2).sum(axis=1) / np.maximum(count, 1), np.inf)
        smallest = 1e-24 * np.array([np.mean(m**2) + 1e-300 for m in self.measured])
        effective = [
            n / (1 + 2 * correlation_time(own)) for n, own in zip(count, left, strict=True)
        ]
        return 1 / np.maximum(sigma2, smallest), np.array(effective)

    def normal(self, left: Array) -> tuple[Array, Array, Array, float]:
        """Information, pull, weighted Jacobian and effective samples where the noise is `left`."""
        weight, alike = self.weights(left)
        # counted as its effective number of samples, so that priors keep their say
        weight = weight * alike / np.maximum(self.keep.sum(axis=1), 1)
        kept = np.where(self.keep[..., None], self.jacobian, 0.0)
        weighted = kept * weight[:, None, None]
        information = np.einsum("eni,enj->ij", weighted, kept)
        pull = -np.einsum("eni,en->i", weighted, self.residual)
        return information, pull, weighted, float(alike.sum())


@dataclass(frozen=True)
class Prior:
    """Independent Gaussian beliefs: ``inf`` in ``sigma`` (unknowns,) where there is none."""

    mean: Array
    sigma: Array

    def precision(self) -> Array:
        """1 / variance, 0 where nothing is believed."""
        return np.where(np.isfinite(self.sigma), 1 / self.sigma**2, 0.0)


@dataclass(frozen=True)
class Solution:
    """Step from the point of linearisation, its covariance and what the data leaves open.

    ``step`` respects the bounds, ``free_step`` does not (intervals are centred on it);
    ``covariance`` (unknowns, unknowns) holds for the directions the data sees; ``open`` marks
    unknowns that move along a direction it does not see; ``singular`` are the singular values of
    the information matrix' root, columns scaled alike, largest first; ``effective`` is the
    effective number of samples.
    """

    step: Array
    free_step: Array
    covariance: Array
    open: Flags
    singular: Array
    directions: Array
    effective: float

    @property
    def width(self) -> Array:
        """One standard deviation of every unknown, ``inf`` where the data leaves it open."""
        sigma = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return np.where(self.open, np.inf, sigma)

    @property
    def condition(self) -> float:
        """Ratio of the largest to the smallest singular value; ``inf`` if one is zero."""
        smallest = self.singular[-1]
        zero = smallest <= RANK * self.singular[0]
        return float("inf") if zero else float(self.singular[0] / smallest)

    @property
    def correlation(self) -> Array:
        """Of the unknowns, shape (unknowns, unknowns)."""
        sigma = np.sqrt(np.diag(self.covariance))
        safe = np.where(sigma > 0, sigma, 1.0)
        result: Array = self.covariance / np.outer(safe, safe)
        return result


def solve(
    records: Sequence[Rows], prior: Prior, low: Array, high: Array, *, long_run: bool = True
) -> Solution:
    """The step that makes the weighted residuals and the priors smallest.

    Args:
        records: rows at the point of linearisation.
        prior: of the *step*: mean and spread relative to that point.
        low: lower bounds of the step, shape (unknowns,), ``-inf`` where there is none.
        high: upper bounds of the step.
        long_run: false takes the residuals for white, which is quick; for steps before the last.

    Raises:
        ValueError: no sample is left to fit.

    """
    if not any(rows.keep.any() for rows in records):
        raise ValueError("torque balance: every sample is masked; lower the standstill speed")
    unknowns = records[0].jacobian.shape[-1]
    nothing = np.zeros(unknowns)
    # The noise is what is left where the records alone would have the unknowns. Taken at the data
    # sheet, the sheet's own error would count as noise, and so keep the unknowns there.
    apart = [rows.normal(rows.after(nothing)) for rows in records]
    alone, *_ = _scaled(*_sums(apart, nothing, nothing), low, high)
    parts = [rows.normal(rows.after(alone)) for rows in records]
    scores, effective = [part[2] for part in parts], sum(part[3] for part in parts)
    precision = prior.precision()
    total, pull = _sums(parts, precision, prior.mean)
    step, free_step, scale, root = _scaled(total, pull, low, high)
    singular, directions = root
    seen = singular > RANK * singular[0]
    inverse = (directions[:, seen] / singular[seen] ** 2) @ directions[:, seen].T
    inverse = inverse * np.outer(scale, scale)
    covariance = inverse
    if long_run:
        left = [rows.after(step) for rows in records]
        spread = sum(scatter_of_scores(w, r) for w, r in zip(scores, left, strict=True))
        even = sum(scatter_if_stationary(w, r) for w, r in zip(scores, left, strict=True))
        few = effective / max(effective - unknowns, 1.0)
        covariance = _wider(
            *(inverse @ (few * s + np.diag(precision)) @ inverse for s in (spread, even))
        )
    return Solution(
        step,
        free_step,
        covariance,
        (directions[:, ~seen] ** 2).sum(axis=1) > 1e-6,
        singular,
        directions,
        effective,
    )


def _sums(
    parts: Sequence[tuple[Array, Array, Array, float]], precision: Array, mean: Array
) -> tuple[Array, Array]:
    """Normal matrix and right side of records and priors together."""
    information = sum((part[0] for part in parts), np.diag(precision))
    return information, sum((part[1] for part in parts), precision * mean)


def _scaled(
    matrix: Array, pull: Array, low: Array, high: Array
) -> tuple[Array, Array, Array, tuple[Array, Array]]:
    """Step, the step without bounds, the columns' scale and the scaled root (`_bounded`)."""
    scale = 1 / np.sqrt(np.where(np.diag(matrix) > 0, np.diag(matrix), 1.0))
    step, free, root = _bounded(
        matrix * np.outer(scale, scale), pull * scale, low / scale, high / scale
    )
    return step * scale, free * scale, scale, root


def _wider(first: Array, second: Array) -> Array:
    """The first covariance, stretched to the second's variances where those are larger."""
    own, other = np.diag(first), np.diag(second)
    stretch = np.sqrt(np.maximum(1.0, other / np.where(own > 0, own, np.inf)))
    result: Array = first * np.outer(stretch, stretch)
    return result


def _bounded(
    matrix: Array, pull: Array, low: Array, high: Array
) -> tuple[Array, Array, tuple[Array, Array]]:
    """Minimise x' M x / 2 - pull' x within bounds, shortest step along what M does not see."""
    values, directions = np.linalg.eigh(matrix)
    order = np.argsort(values)[::-1]
    singular, directions = np.sqrt(np.maximum(values[order], 0)), directions[:, order]
    seen = singular > RANK * singular[0]
    root = directions[:, seen] * singular[seen]
    target = (directions[:, seen].T @ pull) / singular[seen]
    free, *_ = np.linalg.lstsq(root.T, target, rcond=None)
    if np.all(free >= low) and np.all(free <= high):
        return free, free, (singular, directions)
    from scipy.optimize import lsq_linear

    bounded = lsq_linear(root.T, target, bounds=(low, high), method="bvls")
    return np.asarray(bounded.x), free, (singular, directions)
