"""Levenberg-Marquardt on whitened innovations and priors, within bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.variant import Point, Variant, flat

Array = NDArray[np.float64]

_DAMPINGS = (1e-4, 1e-1, 10.0)
_SHORTER = (1.0, 0.3)
_ENOUGH = 0.3  # of the objective: a step that brings less ends the fit


def inflation(point: Point, lengths: Sequence[int] = (1, 50, 400)) -> float:
    """By how much whitened residuals still count themselves, from sums over blocks; 1 if white."""
    worst = 1.0
    for m in lengths:
        total, rows = 0.0, 0
        for r in point.residuals:
            n = len(r) // m * m
            if n == 0:
                continue
            sums = r[:n].reshape(-1, m, r.shape[1]).sum(axis=1)
            total += float((sums**2).sum()) / m
            rows += sums.size
        worst = max(worst, total / rows if rows else 1.0)
    return worst


def fit(
    grey: GreyBox,
    variant: Variant,
    theta: Array,
    gains: Sequence[Any],
    *,
    steps: int = 6,
    shared_columns: Sequence[Array] | None = None,
    refresh: Sequence[int] = (0, 2, 4, 6, 8),
) -> Point:
    """Refit a variant from a point, gains held.

    Args:
        grey: records and shared unknowns.
        variant: what is fitted.
        theta: where it begins.
        gains: of `GreyBox.gains`.
        steps: most iterations.
        shared_columns: derivatives by the shared unknowns to begin with (a chord).
        refresh: iterations at which derivatives by the shared unknowns are taken anew.

    """
    low, high = grey.bounds(variant)
    theta = np.clip(theta, low, high)
    [now] = grey.points([variant], [theta], gains)
    n, m = len(theta), grey.shared
    weight = np.r_[1.0 / grey.sigma, np.zeros(n - m)]
    centre = np.r_[grey.centre, np.zeros(n - m)]
    columns = list(shared_columns) if shared_columns is not None else None
    history = [now.chi2]
    for step in range(steps):
        if grey.counter.stop():
            break
        s = 1.0 / inflation(now)
        if columns is None or (step in refresh and (step or shared_columns is None)):
            columns = grey.columns(now, range(m), gains)
        own = grey.columns(now, range(m, n), gains)
        J = np.stack([*(columns or []), *own])
        r = flat(now.residuals)
        off = (now.theta - centre) * weight
        H = s * (J @ J.T) + np.diag(weight**2)
        g = s * (J @ r) + off * weight
        objective = s * now.chi2 + now.prior
        best = None
        trials: list[Array] = []
        for damping in _DAMPINGS:
            damped = H + damping * np.diag(np.diag(H) + 1e-12)
            d = step_within(damped, g, low - now.theta, high - now.theta)
            trials += [np.clip(now.theta + a * d, low, high) for a in _SHORTER]
        for batch in (trials[:2], trials[2:4], trials[4:]):
            found = grey.points([variant] * len(batch), batch, gains)
            costs = [s * p.chi2 + p.prior for p in found]
            k = int(np.argmin(costs))
            if costs[k] < objective:
                best = found[k], costs[k]
                break
        if best is None:
            if step not in refresh and shared_columns is not None:
                shared_columns, columns = None, None  # the chord is worn out
                continue
            break
        now, cost = best
        history.append(now.chi2)
        if objective - cost < _ENOUGH:
            break
    return replace(now, history=tuple(history))


def step_within(H: Array, g: Array, low: Array, high: Array) -> Array:
    """Newton step in a box about zero, shape (n,) all.

    What would leave it is held at its bound and the rest solved anew: a number that the records
    hardly tell may not shorten the step of those that they tell.
    """
    d, held = np.zeros(len(g)), np.zeros(len(g), dtype=bool)
    for _ in range(len(g)):
        move = ~held
        d[move] = -np.linalg.solve(H[np.ix_(move, move)], g[move] + H[np.ix_(move, held)] @ d[held])
        beyond = move & ((d > high) | (d < low))
        if not beyond.any():
            break
        d[beyond] = np.clip(d, low, high)[beyond]
        held |= beyond
    return d
