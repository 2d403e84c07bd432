"""Levenberg-Marquardt on whitened rows, with few evaluations.

Slopes cost a dozen evaluations. They are therefore kept from step to step and mended by every one
made on the way (Broyden's update), and computed afresh only where a step gains much less than they
foretell.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.algebra import scales
from dualdrive.diagnose.evidence import Evidence

Array = NDArray[np.float64]

_SETTLED = 0.3  # a fall of chi^2 that tells nothing
_REJECTED = 5  # steps in a row that gain nothing, before a descent ends
_GOOD, _POOR = 0.75, 0.25  # share of the foretold gain that came
_FIRST_DAMPING, _MOST_DAMPING = 1e-4, 1e6


@dataclass(frozen=True, eq=False)
class Point:
    """Where a descent stands.

    x:        nuisances, then effects' numbers, shape (m + k,)
    left:     per series, what is left, (n,); jacobian: its derivatives, (n, m + k)
    chi:      chi^2, priors included
    """

    x: Array
    left: Sequence[Array]
    jacobian: Sequence[Array]
    chi: float


class Problem(Protocol):
    """What a descent is told of a hypothesis."""

    evidence: Evidence
    low: Array
    high: Array

    def left(self, x: Array) -> list[Array] | None:
        """What is left at x; None where no balance shows it."""

    def renewed(self, point: Point) -> list[Array] | None:
        """Better derivatives at a point; None where there are none, or none worth their time."""


def descend(
    problem: Problem, begin: Point, steps: int, stop: Callable[[], bool]
) -> tuple[Point, bool]:
    """The lowest point reached, and whether the descent ended by itself (not by `stop`).

    steps: how many are tried at most
    """
    at, damping, rejected = begin, _FIRST_DAMPING, 0
    for _ in range(steps):
        if stop():
            return at, False
        step, foretold = _step(problem, at, damping)
        if step is None or foretold < _SETTLED:
            better = problem.renewed(at)
            if better is None:
                break
            at, damping = replace(at, jacobian=better), _FIRST_DAMPING
            continue
        left = problem.left(at.x + step)
        if left is None:
            damping, rejected = _stiffer(damping), rejected + 1
        else:
            there = _moved(problem, at, step, left)
            share = (at.chi - there.chi) / foretold
            if there.chi < at.chi:
                settled = at.chi - there.chi < _SETTLED
                at, rejected = there, 0
                damping = damping / 10 if share > _GOOD else damping * (4 if share < _POOR else 1)
                damping = max(damping, 1e-8)
            else:
                at = replace(at, jacobian=there.jacobian)
                damping, rejected, settled = _stiffer(damping), rejected + 1, False
            if settled or share < _POOR:
                better = problem.renewed(at)
                if better is not None:
                    at, damping = replace(at, jacobian=better), min(damping, 1e-2)
                elif settled:
                    break
        if rejected >= _REJECTED or damping > _MOST_DAMPING:
            break
    return at, True


def _stiffer(damping: float) -> float:
    return max(damping, _FIRST_DAMPING) * 10


def _moved(problem: Problem, at: Point, step: Array, left: Sequence[Array]) -> Point:
    """The point after a step, its derivatives mended so that they foretell that step.

    Broyden's rank-one update in coordinates scaled by how strongly the rows see each of them.
    """
    weight = _curvature(problem.evidence, at.jacobian)
    direction = weight * step
    direction = direction / float(direction @ step)
    mended = [
        j + np.outer(there - here - j @ step, direction)
        for j, here, there in zip(at.jacobian, at.left, left, strict=True)
    ]
    m = len(problem.evidence.confrontation.sigma)
    x = at.x + step
    return Point(x, left, mended, problem.evidence.chi(x[:m], left))


def _curvature(seen: Evidence, jacobian: Sequence[Array]) -> Array:
    rows = seen.white(jacobian)
    own = np.einsum("ij,ij->j", rows, rows)
    m = len(seen.confrontation.sigma)
    sigma = seen.confrontation.sigma
    own[:m] += np.where(np.isfinite(sigma), 1.0 / sigma**2, 0.0)
    result: Array = np.maximum(own, 1e-300)
    return result


def _step(problem: Problem, at: Point, damping: float) -> tuple[Array | None, float]:
    """The damped step inside the bounds, and the fall of chi^2 it foretells."""
    seen = problem.evidence
    c = seen.confrontation
    m = len(c.sigma)
    jacobian, left = seen.white(at.jacobian), seen.white(at.left)
    known = np.isfinite(c.sigma)
    belief = np.zeros(len(at.x))
    belief[:m] = np.where(known, 1.0 / c.sigma**2, 0.0)
    gradient = jacobian.T @ left
    gradient[:m] += np.where(known, (at.x[:m] - c.centre) * belief[:m], 0.0)
    gram = jacobian.T @ jacobian + np.diag(belief)
    step = bounded_step(gram, gradient, damping, problem.low - at.x, problem.high - at.x)
    if not np.isfinite(step).all() or not step.any():
        return None, 0.0
    return step, float(-(2 * gradient @ step + step @ gram @ step))


def bounded_step(gram: Array, gradient: Array, damping: float, low: Array, high: Array) -> Array:
    """The damped step inside its bounds: what would leave them is held there, the rest solved."""
    scale = scales(gram)
    free = np.ones(len(gradient), dtype=bool)
    step = np.zeros(len(gradient))
    for _ in range(len(gradient)):
        rows = np.flatnonzero(free)
        if not len(rows):
            break
        right = gradient + gram @ np.where(free, 0.0, step)
        even = gram[np.ix_(rows, rows)] * np.outer(scale[rows], scale[rows])
        even[np.diag_indices_from(even)] += damping + 1e-10
        step[rows] = -scale[rows] * np.linalg.solve(even, scale[rows] * right[rows])
        outside = free & ((step < low) | (step > high))
        if not outside.any():
            break
        step = np.clip(step, low, high)
        free &= ~outside
    result: Array = np.clip(step, low, high)
    return result
