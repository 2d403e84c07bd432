"""Levenberg-Marquardt on whitened innovations and priors, within bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations.derivatives import slopes, slopes_nearby
from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.variant import Point, Variant, flat

Array = NDArray[np.float64]

_DAMPINGS = (1e-4, 1e-1, 10.0)
SHORTER = (1.0, 0.3)
_BENT = 0.75  # of a step, that what its curvature adds may be (Transtrum, Sethna)
_FORETOLD = 0.2  # of the gain that is promised: how far that of a step along a chord may be off
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
    rival: float = -np.inf,
    nearby: bool = False,
    begun: Point | None = None,
) -> Point:
    """Refit a variant from a point, gains held.

    Args:
        grey: records and shared unknowns.
        variant: what is fitted.
        theta: where it begins.
        gains: of `GreyBox.gains`.
        steps: most iterations.
        shared_columns: derivatives by the shared unknowns to begin with (a chord).
        rival: sum of squares and priors of what leads: a fit that would not come up to it at its
            present rate within the steps that it has left ends at once.
        nearby: whether slopes may be told nearby (`slopes_nearby`) while they serve: it is to come
            near under much unknown torque, and need not end where the exact ones would have it.
        begun: what it leaves where it begins, under these gains, if that is known.

    """
    low, high = grey.bounds(variant)
    theta = np.clip(theta, low, high)
    if begun is None or not np.array_equal(begun.theta, theta):
        [begun] = grey.points([variant], [theta], gains)
    now = begun
    centre, precision = grey.believed(variant)
    shared = _Shared(grey, gains, shared_columns, nearby)
    for left in reversed(range(steps)):
        if grey.counter.stop():
            break
        s = 1.0 / inflation(now)
        J = np.stack(shared.columns_at(now))
        r = flat(now.residuals)
        H = s * (J @ J.T) + np.diag(precision)
        g = s * (J @ r) + precision * (now.theta - centre)
        objective = s * now.chi2 + now.prior
        best = None
        for damping in _DAMPINGS:
            damped = H + damping * np.diag(np.diag(H) + 1e-12)
            ends = low - now.theta, high - now.theta
            d = step_within(damped, g, *ends)
            trials = [np.clip(now.theta + a * d, low, high) for a in SHORTER]
            found = grey.points([variant] * len(trials), trials, gains)
            bent = curvature(r, flat(found[-1].residuals), d @ J, SHORTER[-1])
            turn = step_within(damped, g + s * (J @ bent), *ends) - d
            if gentle(turn @ J, d @ J):
                found += grey.points([variant], [np.clip(now.theta + d + turn, low, high)], gains)
            costs = [s * p.chi2 + p.prior for p in found]
            k = int(np.argmin(costs))
            if costs[k] < objective:
                best = found[k], costs[k]
                break
            if shared.are_a_chord:
                break  # it is worn out
        if best is None:
            if not shared.others():
                break
            continue
        gained = now.chi2 + now.prior - best[0].chi2 - best[0].prior
        now, cost = best
        shared.kept(as_foretold(objective - cost, promised(g, H, d)))
        behind = now.chi2 + now.prior - left * gained > rival > -np.inf
        if objective - cost < _ENOUGH or behind:
            break
    return now


class _Shared:
    """Derivatives by the shared unknowns, which serve while steps bring what they promise.

    Attributes:
        are_a_chord: those of another point, exact there.

    """

    def __init__(
        self,
        grey: GreyBox,
        gains: Sequence[Any],
        columns: Sequence[Array] | None,
        nearby: bool,
    ) -> None:
        self._grey, self._gains = grey, gains
        self._columns = None if columns is None else list(columns)
        self._may_be_nearby, self._are_nearby = nearby, False
        self.are_a_chord = columns is not None

    def columns_at(self, now: Point) -> list[Array]:
        """Derivatives by all unknowns, those by the shared ones as they are held."""
        m, n = self._grey.shared, len(now.theta)
        if self._columns is not None:
            return [*self._columns, *slopes(self._grey, now, range(m, n), self._gains)]
        if self._may_be_nearby:
            every, exact = slopes_nearby(self._grey, now, self._gains)
        else:
            every, exact = slopes(self._grey, now, range(n), self._gains), True
        self._columns, self._are_nearby, self.are_a_chord = every[:m], not exact, False
        return every

    def others(self) -> bool:
        """Whether there are others than those that led nowhere: of this point, or exact."""
        if not (self.are_a_chord or self._are_nearby):
            return False
        self._may_be_nearby &= not self._are_nearby
        self._columns = None
        return True

    def kept(self, served: bool) -> None:
        """A step was taken with them: those that served go on, as a chord if they were exact."""
        self.are_a_chord = served and not self._are_nearby
        self._columns = self._columns if served else None


def curvature(r: Array, there: Array, along: Array, share: float) -> Array:
    """Half the second derivative of residuals along a step, from those at a share of it.

    The step that allows for it goes along a bent valley instead of across it (geodesic
    acceleration: Transtrum, Sethna, arXiv:1201.5885, 2012).
    """
    bent: Array = (there - r - share * along) / share**2
    return bent


def promised(g: Array, H: Array, d: Array) -> float:
    """What a step would gain of an objective that bends everywhere as it does here.

    Args:
        g: half the gradient.
        H: half its derivatives.
        d: the step.

    """
    return -float(2.0 * (g @ d) + d @ H @ d)


def as_foretold(gained: float, gain: float) -> bool:
    """Whether a step gains what its derivatives promised: they serve once more as a chord."""
    return abs(gained - gain) < _FORETOLD * gain


def gentle(turn: Array, along: Array) -> bool:
    """Whether what the curvature adds to a step is little enough to be believed."""
    return bool(np.linalg.norm(turn) < _BENT * np.linalg.norm(along))


def covariance(information: Array) -> Array:
    """The generalized inverse of an information, its unknowns in units of their own.

    An unknown that nothing tells of has a row of zeros there, and here.

    Args:
        information: symmetric, shape (unknowns, unknowns).

    """
    units = np.sqrt(np.diag(information) + 1e-300)
    scaled: Array = np.linalg.pinv(information / np.outer(units, units), hermitian=True)
    found: Array = scaled / np.outer(units, units)
    return found


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
