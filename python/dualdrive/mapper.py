"""Independent evaluations, computed side by side: what a fit is spread by."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any, Protocol, TypeVar

__all__ = ["Mapper", "Threads", "mapped"]

T = TypeVar("T")
R = TypeVar("R")


class Mapper(Protocol):
    """Where evaluations are computed. Results do not depend on it.

    near: whether evaluations share the memory of this process, so that they can be watched
    """

    near: bool

    def keep(self, value: T) -> T:
        """What to pass to evaluations in place of a value that many of them read."""

    def as_finished(
        self,
        do: Callable[..., R],
        jobs: Sequence[tuple[Any, ...]],
        stop: threading.Event | None = None,
    ) -> Iterator[tuple[int, R]]:
        """Yield (number of the job, do(*job)) as they finish.

        When `stop` is set no job is begun any more; those under way are still handed over.
        """


def mapped(mapper: Mapper, do: Callable[..., R], jobs: Sequence[tuple[Any, ...]]) -> list[R]:
    """Every do(*job), in the order of the jobs."""
    found = dict(mapper.as_finished(do, jobs))
    return [found[k] for k in range(len(jobs))]


class Threads:
    """Threads of this process; a single job runs in the calling one, where Ctrl-C reaches it."""

    near = True

    def __init__(self, most: int | None = None) -> None:
        self._most = most

    def keep(self, value: T) -> T:
        """See `Mapper`."""
        return value

    def as_finished(
        self,
        do: Callable[..., R],
        jobs: Sequence[tuple[Any, ...]],
        stop: threading.Event | None = None,
    ) -> Iterator[tuple[int, R]]:
        """See `Mapper`."""
        if self._most == 1 or len(jobs) == 1:
            for k, job in enumerate(jobs):
                if stop is None or not stop.is_set():
                    yield k, do(*job)
            return

        def begin(job: tuple[Any, ...]) -> list[R]:
            return [] if stop is not None and stop.is_set() else [do(*job)]

        with ThreadPoolExecutor(self._most) as pool:
            running = {pool.submit(begin, job): k for k, job in enumerate(jobs)}
            try:
                for future in as_completed(running):
                    for result in future.result():
                        yield running[future], result
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
