"""Least squares in rounds, weights renewed in between, from one starting point."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.distributed import SchedulerError
from dualdrive.identify.closed_loop import FitError, Problem
from dualdrive.mapper import Threads

Array = NDArray[np.float64]

_SETTLED = 1.15  # weights that move by a smaller factor have settled


@dataclass(frozen=True)
class Progress:
    """Where a fit stands: number of the start, its simulations so far, cost and its best cost."""

    start: int
    simulations: int
    cost: float
    best: float


@dataclass(frozen=True)
class Rules:
    """When a descent ends: simulated records, relative change of cost and unknowns, rounds."""

    limit: int
    precision: float
    rounds: int


@dataclass(frozen=True, eq=False)
class End:
    """Where a descent came to from one starting point.

    point:   the last point, or the best one seen if it was stopped; None if none was simulated
    error:   why it could not go on; "" if it could
    size:    sum of n log RMS over the channels there: comparable whatever the weights were
    """

    point: Array | None
    status: str
    message: str
    error: str
    cost: float
    simulations: int
    failures: tuple[str, ...]
    size: float = math.inf


class _EnoughError(Exception):
    """As many simulations as were allowed, or a stop."""


class Descent:
    """One descent from one starting point; remembers the best point seen if it is stopped."""

    def __init__(
        self,
        problem: Problem,
        number: int,
        rules: Rules,
        progress: Callable[[Progress], None] | None = None,
        stop: threading.Event | None = None,
    ) -> None:
        self.problem, self.number, self.rules = problem, number, rules
        self.progress, self.stop = progress, stop
        self.best, self.status, self.message = problem.start, "success", ""
        self._cost, self._begun, self._first = math.inf, False, problem.runs

    def run(self, u: Array) -> End:
        """Descend from u."""
        error, ended = "", False
        try:
            self.best, ended = self._descend(u), True
        except FitError as failure:
            error = str(failure)
            self._end("not_converged", error)
        except KeyboardInterrupt:
            self._end("interrupted", "stopped on request")
        except SchedulerError as failure:
            self.problem.mapper = Threads()  # what is left to do is done here
            self._end("not_converged", str(failure))
        except _EnoughError as failure:
            stopped = self.stop is not None and self.stop.is_set()
            self._end("interrupted" if stopped else "not_converged", str(failure))
        known = ended or self._begun
        return End(
            self.best if known else None,
            self.status,
            self.message,
            error,
            self._cost,
            self.problem.runs - self._first,
            tuple(self.problem.failures),
        )

    def _end(self, status: str, why: str) -> None:
        self.status, self.message = status, f"{why}; this is the best point so far"

    def _descend(self, u: Array) -> Array:
        from scipy.optimize import least_squares

        u = self.problem.levelled(u)
        self.problem.reweigh(u)
        # Constants and first states are told apart: a few products with the tall Jacobian do. A
        # machine's numbers may hardly be, and want its singular values.
        solver: Literal["exact", "lsmr"] = "exact" if self.problem.parameters else "lsmr"
        for _ in range(self.rules.rounds):
            self._cost = math.inf  # costs under other weights do not compare
            found = least_squares(
                self._residual,
                u,
                self.problem.jacobian,
                bounds=self.problem.bounds,
                method="trf",
                tr_solver=solver,
                x_scale=self.problem.scale,
                ftol=self.rules.precision,
                xtol=self.rules.precision,
                gtol=1e-12,
                max_nfev=40,
            )
            u = self.best = np.asarray(found.x)
            if self.problem.reweigh(u) < _SETTLED:
                break
        return u

    def _residual(self, u: Array) -> Array:
        if self.stop is not None and self.stop.is_set():
            raise _EnoughError("stopped on request")
        if self.problem.runs - self._first >= self.rules.limit:
            raise _EnoughError(f"more than max_simulations = {self.rules.limit}")
        left = self.problem.residual(u)
        cost = 0.5 * float(left @ left) if np.isfinite(left).all() else math.inf
        if cost < self._cost:
            self.best, self._cost, self._begun = u.copy(), cost, True
        if self.progress:
            done = self.problem.runs - self._first
            self.progress(Progress(self.number, done, cost, self._cost))
        return left


def descend(
    rules: Rules,
    problem: Problem,
    number: int,
    u: Array,
    progress: Callable[[Progress], None] | None = None,
    stop: threading.Event | None = None,
) -> End:
    """Descend from one of several starts, beside others that begin from the same problem."""
    own = copy(problem)
    end = Descent(own, number, rules, progress, stop).run(u)
    return end if end.point is None else replace(end, size=size(own, end.point))


def size(problem: Problem, u: Array) -> float:
    """Sum of n log RMS over the channels at a point, infinite where it does not simulate."""
    replays = problem.replays(u)
    if replays is None:
        return math.inf
    left = problem.unweighted(replays, u).values()
    return float(sum(0.5 * len(r) * np.log(np.mean(r**2) + 1e-300) for r in left))
