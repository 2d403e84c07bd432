"""The exact solution of the reference model's equations in one mode, up to its first crossing."""

from __future__ import annotations

from functools import cached_property
from math import ceil

import numpy as np
from scipy.linalg import expm, matrix_balance
from scipy.optimize import brentq

from reference_equations import Array, Assembly, Guard

ORDER = 22  # of the Taylor series over one slice
EXPONENTS = np.arange(ORDER + 1)
SLICE = 0.5  # a slice lasts this over the fastest eigenvalue: 0.5^22/22! = 2e-28
ROUNDING = 1e-13  # below this share of its terms a quantity is zero


class Mode:
    """ż = A z with its guards: sampled, searched for the first crossing, and followed up to it."""

    def __init__(self, assembly: Assembly, grid: float) -> None:
        self.assembly, self.A, self.grid = assembly, assembly.A, grid
        self.guards = assembly.guards
        self.rows = np.array([guard.row for guard in self.guards])
        self.fastest = float(np.abs(np.linalg.eigvals(self.A)).max())

    @cached_property
    def guard_rates(self) -> list[Array]:
        """Rows of the guards and of their first three derivatives."""
        rows = [self.rows]
        for _ in range(3):
            rows.append(rows[-1] @ self.A)
        return rows

    @cached_property
    def table(self) -> Array:
        """exp(A t) at every slice of a whole grid step, shape (slices + 1, states, states)."""
        n = self.slices(self.grid)
        balanced, (scale, _) = matrix_balance(self.A, permute=False, separate=True)
        one = expm(balanced * (self.grid / n)) * scale[:, None] / scale[None, :]
        powers = [np.eye(len(self.A))]
        for _ in range(n):
            powers.append(one @ powers[-1])
        return np.array(powers)

    def slices(self, span: float) -> int:
        return max(1, ceil(self.fastest * span / SLICE))

    def series(self, z: Array, span: float) -> Array:
        """Return the Taylor coefficients of z(t), t in units of span; shape (ORDER + 1, states)."""
        terms = np.empty((ORDER + 1, len(z)))
        terms[0] = z
        for k in range(1, ORDER + 1):
            terms[k] = self.A @ terms[k - 1] * (span / k)
        return terms

    def samples(self, z: Array, span: float) -> Array:
        if span == self.grid:
            return self.table @ z
        states = [z]
        for _ in range(n := self.slices(span)):
            states.append(self.series(states[-1], span / n).sum(axis=0))
        return np.array(states)

    def margin(self, z: Array, order: int) -> tuple[Array, Array]:
        """Return a derivative of every guard, and the size of its terms."""
        rows = self.guard_rates[order]
        return rows @ z, np.abs(rows) @ np.abs(z)

    def signs(self, z: Array) -> Array:
        """Return the sign every guard takes at once: that of its first derivative not zero."""
        sign = np.zeros(len(self.guards))
        for order in range(len(self.guard_rates)):
            value, size = self.margin(z, order)
            undecided = (sign == 0) & (np.abs(value) > ROUNDING * size)
            sign[undecided] = np.sign(value[undecided])
        return sign

    def advance(self, z: Array, span: float) -> tuple[float, Guard | None, Array]:
        """Follow the mode for `span` or up to its first crossing: time passed, guard, state."""
        states = self.samples(z, span)
        width = span / (len(states) - 1)
        value, slope = states @ self.rows.T, states @ self.guard_rates[1].T
        turning = (slope[:-1] < 0) & (slope[1:] > 0)
        suspect = (value[:-1] <= 0) | (value[1:] <= 0) | turning
        suspect[0] |= np.abs(value[0]) <= ROUNDING * self.margin(z, 0)[1]
        for k in map(int, np.flatnonzero(suspect.any(axis=1))):
            terms = self.series(states[k], width)
            crossings = []
            for n in map(int, np.flatnonzero(suspect[k])):
                at = self._crossing(terms @ self.rows[n], states[k], n, width)
                if at is not None:
                    crossings.append((at, n))
            if crossings:
                at, n = min(crossings)
                return (k + at) * width, self.guards[n], np.power(at, EXPONENTS) @ terms
        return span, None, states[-1]

    def _crossing(self, guard: Array, z: Array, n: int, width: float) -> float | None:
        """Return the first zero in (0, 1] of a guard's series; 0 if it is negative at once.

        A zero the slice starts on is divided out. Between the samples an interior minimum is looked
        for as well, so that a contact shorter than a sample is not lost.
        """
        lowest = 0
        for rows in self.guard_rates:
            if abs(rows[n] @ z) > ROUNDING * (np.abs(rows[n]) @ np.abs(z)):
                break
            lowest += 1
        else:
            return None
        if guard[lowest] < 0:
            return 0.0
        q = guard[lowest:].tolist()
        slope = [k * term for k, term in enumerate(q)][1:]
        at = [k / 8 for k in range(9)]
        value, rise = ([horner(series, t) for t in at] for series in (q, slope))
        for left, right, here, before, after in zip(
            at, at[1:], value[1:], rise, rise[1:], strict=False
        ):
            if here <= 0:
                return root(q, left, right)
            if before < 0 < after:
                lowest_point = root(slope, left, right)
                if horner(q, lowest_point) <= 0:
                    return root(q, left, lowest_point)
        return None


def horner(series: list[float], t: float) -> float:
    value = 0.0
    for term in reversed(series):
        value = value * t + term
    return value


def root(series: list[float], left: float, right: float) -> float:
    return float(brentq(lambda t: horner(series, t), left, right, xtol=1e-16, rtol=1e-15))
