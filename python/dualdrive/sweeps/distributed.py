"""Runs of a sweep on the workers of a Dask scheduler: chunks of numbers out, outcomes back."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from .executors import Threads

if TYPE_CHECKING:
    from dualdrive.distributed import Cluster
    from dualdrive.ensembles import Outcome

    from .plan import Plan

__all__ = ["Workers"]

CHUNK_TIME = 0.5  # s of computing: far above what handing a chunk over costs, and soon done again
CHUNK_BYTES = 16e6  # of signals kept whole, for they travel in one piece
_GROWTH = 4  # times as many runs as in the chunk before, at most


class Workers:
    """The workers of a cluster, each of its threads at a chunk of its own. An `Executor`."""

    def __init__(self, cluster: Cluster) -> None:
        self._cluster = cluster
        self._size = 1

    def outcomes(
        self, plan: Plan, runs: Sequence[int], stop: threading.Event
    ) -> Iterator[list[Outcome]]:
        """See `Executor`. Raises SchedulerError when the scheduler or all its workers are lost."""
        kept = self._cluster.keep(plan)
        most = max(1, int(CHUNK_BYTES / (8 * plan.kept.size))) if plan.kept else len(runs)
        chunks = ((kept, chunk) for chunk in self._chunks(runs, most))
        for _, (outcomes, elapsed) in self._cluster.as_finished(compute, chunks, stop):
            wanted = int(CHUNK_TIME / max(elapsed, 1e-6) * len(outcomes))
            self._size = max(1, min(wanted, _GROWTH * len(outcomes), most))
            yield outcomes

    def _chunks(self, runs: Sequence[int], most: int) -> Iterator[tuple[int, ...]]:
        """Runs in order, as many at a time as their speed suggests; fewer towards the end."""
        at = 0
        while at < len(runs):
            fair = -(-(len(runs) - at) // (2 * max(1, self._cluster.threads)))
            size = min(self._size, most, fair)
            yield tuple(runs[at : at + size])
            at += size


def compute(plan: Plan, runs: Sequence[int]) -> tuple[list[Outcome], float]:
    """On a worker, in one of its threads: what these runs leave, and how long they took in s."""
    began = time.perf_counter()
    batches = Threads(1).outcomes(plan, runs, threading.Event())
    return [outcome for batch in batches for outcome in batch], time.perf_counter() - began
