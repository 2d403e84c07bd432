"""Where the runs of a sweep are computed: numbers of runs in, outcomes out.

An executor knows nothing of the file, and the file nothing of the executor: results are the same to
the last bit wherever they were computed.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from .grid import GridError
from .parallel import as_finished, cores

if TYPE_CHECKING:
    from .grid_file import Outcome
    from .plan import Plan

__all__ = ["Executor", "Threads"]


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
        return as_finished(plan.run, runs, self.jobs or cores(), stop)
