"""Least squares in rounds, weights renewed in between, from one or several starting points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.closed_loop import FitError, Problem

Array = NDArray[np.float64]

ROUNDS = 8  # of fitting and weighing anew
_SETTLED = 1.15  # weights that move by a smaller factor have settled
_DECADES = 1.0  # other starts put an effect within ten times its usual size, up or down


@dataclass(frozen=True)
class Progress:
    """Where a fit stands: number of the start, simulations so far, cost and the best cost."""

    start: int
    simulations: int
    cost: float
    best: float


class _EnoughError(Exception):
    """As many simulations as were allowed."""


class Search:
    """Looks for the best point of a problem, and keeps the best one seen if it is stopped."""

    def __init__(
        self,
        problem: Problem,
        limit: int = 1000,
        progress: Callable[[Progress], None] | None = None,
        precision: float = 1e-6,
        rounds: int = ROUNDS,
    ) -> None:
        self.problem, self.limit, self.progress = problem, limit, progress
        self.precision = precision  # relative, of cost and unknowns
        self.rounds = rounds if problem.size else 0
        self.best, self.status, self.message = problem.start, "success", ""
        self._cost, self._number, self._begun = math.inf, 1, False

    def run(self, starts: int = 1, seed: int = 0) -> None:
        """Leave the best point in `best`, and in `status` how the search ended.

        Raises:
            FitError: no starting point simulates.

        """
        random, ends, errors = np.random.default_rng(seed), [], []
        try:
            for self._number in range(1, starts + 1):
                try:
                    ends.append(self._descend(self._begin(random)))
                except FitError as error:
                    errors.append(str(error))
        except KeyboardInterrupt:
            self._end("interrupted", "stopped on request")
        except _EnoughError:
            self._end("not_converged", f"more than max_simulations = {self.limit}")
        if not ends and not self._begun:
            raise FitError(errors[0] if errors else "stopped before the first simulation ended")
        if ends:
            stopped_at = [] if self.status == "success" else [self.best]
            self.best = min([*ends, *stopped_at], key=self._size)

    def _end(self, status: str, why: str) -> None:
        self.status, self.message = status, f"{why}; this is the best point so far"

    def _begin(self, random: np.random.Generator) -> Array:
        """The nominal machine first, then draws from the priors."""
        u = self.problem.start
        if self._number == 1:
            return u
        for k, p in enumerate(self.problem.parameters):
            if math.isfinite(p.sigma):
                u[k] = p.centre + p.sigma * random.standard_normal()
            else:
                u[k] *= 10.0 ** random.uniform(-_DECADES, _DECADES)
        low, high = self.problem.bounds
        inside: Array = np.clip(u, low, high)
        return inside

    def _descend(self, u: Array) -> Array:
        from scipy.optimize import least_squares

        u = self.problem.levelled(u)
        self.problem.reweigh(u)
        for _ in range(self.rounds):
            self._cost = math.inf  # costs under other weights do not compare
            found = least_squares(
                self._residual,
                u,
                self.problem.jacobian,
                bounds=self.problem.bounds,
                method="trf",
                x_scale=self.problem.scale,
                ftol=self.precision,
                xtol=self.precision,
                gtol=1e-12,
                max_nfev=40,
            )
            u = self.best = np.asarray(found.x)
            if self.problem.reweigh(u) < _SETTLED:
                break
        return u

    def _residual(self, u: Array) -> Array:
        if self.problem.runs >= self.limit:
            raise _EnoughError
        left = self.problem.residual(u)
        cost = 0.5 * float(left @ left) if np.isfinite(left).all() else math.inf
        if cost < self._cost:
            self.best, self._cost, self._begun = u.copy(), cost, True
        if self.progress:
            self.progress(Progress(self._number, self.problem.runs, cost, self._cost))
        return left

    def _size(self, u: Array) -> float:
        """Sum of n log RMS over the channels: comparable whatever the weights were."""
        replays = self.problem.replays(u)
        if replays is None:
            return math.inf
        left = self.problem.unweighted(replays, u).values()
        return float(sum(0.5 * len(r) * np.log(np.mean(r**2) + 1e-300) for r in left))
