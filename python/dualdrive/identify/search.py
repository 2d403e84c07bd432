"""The best point of a problem, looked for from one or several starting points side by side."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dualdrive.distributed import SchedulerError
from dualdrive.identify.closed_loop import FitError, Problem
from dualdrive.identify.descent import Descent, End, Progress, Rules, descend, size
from dualdrive.interrupt import interrupt
from dualdrive.mapper import Threads

__all__ = ["Progress", "Search"]

Array = NDArray[np.float64]

ROUNDS = 8  # of fitting and weighing anew
_DECADES = 1.0  # other starts put an effect within ten times its usual size, up or down


class Search:
    """Looks for the best point of a problem from one or several starting points.

    first: where the first descent begins; the data sheet unless `begin_near` finds better
    best, status, message: the best point, and how the descent that found it ended
    """

    def __init__(
        self,
        problem: Problem,
        limit: int = 1000,
        progress: Callable[[Progress], None] | None = None,
        precision: float = 1e-6,
        rounds: int = ROUNDS,
    ) -> None:
        self.problem, self.progress = problem, progress
        self.rules = Rules(limit, precision, rounds if problem.size else 0)
        self.first = self.best = problem.start
        self.status, self.message = "success", ""

    def begin_near(self, estimates: Sequence[Array]) -> None:
        """Begin at the estimate whose simulation misses the records least, if less than at first.

        Args:
            estimates: of the parameters, shape (parameters,) each.

        """
        problem, least = self.problem, math.inf
        low, high = problem.bounds
        rest = problem.start[len(problem.parameters) :]
        for u in [self.first, *(np.clip(np.r_[own, rest], low, high) for own in estimates)]:
            try:
                missed = size(problem, problem.levelled(u))
            except FitError:
                continue
            if missed < least:
                self.first, least = u, missed

    def run(self, starts: int = 1, seed: int = 0) -> None:
        """Leave the best point in `best`, and in `status` how the search ended.

        Raises:
            FitError: no starting point simulates.
            KeyboardInterrupt: Ctrl-C came before anything was known.
            SchedulerError: the workers were lost before a start had ended.

        """
        if starts == 1:
            ends = [Descent(self.problem, 1, self.rules, self.progress).run(self.first)]
        else:
            ends = self._spread(self._beginnings(starts, seed))
        errors = [end.error for end in ends if end.error]
        stopped = any(end.status == "interrupted" for end in ends)
        ends = [end for end in ends if end.point is not None]
        if not ends and stopped:
            raise KeyboardInterrupt
        if not ends:
            raise FitError(errors[0] if errors else "stopped before the first simulation ended")
        found = min(ends, key=lambda end: end.size)
        assert found.point is not None
        self.best = found.point
        if self.status == "success":  # all starts have ended by themselves
            self.status, self.message = found.status, found.message

    def _beginnings(self, starts: int, seed: int) -> list[Array]:
        """The first point, then draws from the priors."""
        random, points = np.random.default_rng(seed), [self.first]
        low, high = self.problem.bounds
        for _ in range(1, starts):
            u = self.problem.start
            for k, p in enumerate(self.problem.parameters):
                if math.isfinite(p.sigma):
                    u[k] = p.centre + p.sigma * random.standard_normal()
                else:
                    u[k] *= 10.0 ** random.uniform(-_DECADES, _DECADES)
            points.append(np.clip(u, low, high))
        return points

    def _spread(self, points: Sequence[Array]) -> list[End]:
        """A descent from each point, side by side; their ends in the order of the points."""
        problem, ends = self.problem, dict[int, End]()
        mapper = problem.mapper
        problem.replays(points[0])  # so that all know how many steps are usual
        with interrupt() as stop:
            task = partial(descend, self.rules)
            if mapper.near:
                task = partial(task, progress=self._in_turn(), stop=stop)
            jobs = [(mapper.keep(problem), k, u) for k, u in enumerate(points, 1)]
            try:
                for k, end in mapper.as_finished(task, jobs, stop):
                    ends[k] = end
                    if self.progress and not mapper.near:
                        self.progress(Progress(k + 1, end.simulations, end.cost, end.cost))
                    if end.status == "interrupted":
                        stop.set()
            except KeyboardInterrupt:
                stop.set()
            except SchedulerError as failure:
                if not ends:
                    raise
                problem.mapper = Threads()  # what is left to do is done here
                self._cut("not_converged", str(failure), len(ends), len(points))
            finally:
                stopped = stop.is_set()
                stop.set()  # whatever ends this ends the others
            if stopped:
                self._cut("interrupted", "stopped on request", len(ends), len(points))
        found = [ends[k] for k in sorted(ends)]
        problem.runs += sum(end.simulations for end in found)
        problem.failures += [text for end in found for text in end.failures]
        return found

    def _cut(self, status: str, why: str, ended: int, starts: int) -> None:
        self.status = status
        self.message = f"{why}; this is the best point so far, of {ended} of {starts} starts"

    def _in_turn(self) -> Callable[[Progress], None] | None:
        """Progress told by several threads, one at a time."""
        tell, turn = self.progress, threading.Lock()
        if tell is None:
            return None

        def told(now: Progress) -> None:
            with turn:
                tell(now)

        return told
