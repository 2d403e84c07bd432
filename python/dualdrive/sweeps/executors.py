"""Where the runs of a sweep are computed: numbers of runs in, outcomes out.

An executor knows nothing of the file, and the file nothing of the executor: results are the same to
the last bit wherever they were computed.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

from .grid import GridError

if TYPE_CHECKING:
    from distributed import Client

    from dualdrive.ensembles import Outcome

    from .plan import Plan

__all__ = ["Executor", "Threads", "executor_for"]


class Executor(Protocol):
    """Computes runs of a plan."""

    def outcomes(
        self, plan: Plan, runs: Sequence[int], stop: threading.Event
    ) -> Iterator[list[Outcome]]:
        """Yield what these runs leave, in lists as they finish: every run once, in any order.

        When `stop` is set no run is begun any more; those under way are still handed over. What
        waits to be handed over is bounded, however many runs there are.
        """


@dataclass(frozen=True)
class Threads:
    """Threads of this process; all cores without a number. Raises GridError below 1."""

    jobs: int | None = None

    def __post_init__(self) -> None:
        if self.jobs is not None and self.jobs < 1:
            raise GridError(f"jobs = {self.jobs}: must be at least 1; leave it out for all cores")

    def outcomes(
        self, plan: Plan, runs: Sequence[int], stop: threading.Event
    ) -> Iterator[list[Outcome]]:
        """See `Executor`."""
        if not runs:
            return
        with plan.ensemble(runs, self.jobs) as under_way:
            for batch in under_way.batches():
                if stop.is_set():
                    under_way.stop()
                if batch:
                    yield [replace(outcome, run=runs[outcome.run]) for outcome in batch]


@contextmanager
def executor_for(jobs: int | None, scheduler: str | Client | None) -> Iterator[Executor]:
    """Threads of this process, or the workers of a Dask scheduler.

    Raises GridError where both are asked for, SchedulerError where the workers can't do the work.
    """
    if scheduler is None:
        yield Threads(jobs)
        return
    if jobs is not None:
        raise GridError(f"jobs = {jobs}: are threads of this process; leave jobs or scheduler out")
    from dualdrive.distributed import connected

    from .distributed import Workers

    with connected(scheduler) as cluster:
        yield Workers(cluster)
