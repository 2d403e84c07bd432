"""What a search works with: its time, its threads, and who is told what it tries."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def first_of_each(several: Iterable[T], key: Callable[[T], str]) -> list[T]:
    """The first with every key, in order."""
    first: dict[str, T] = {}
    for one in several:
        first.setdefault(key(one), one)
    return list(first.values())


class Clock:
    """What is left of a time budget; `stop` turns true when it is used up or a user asks."""

    def __init__(self, budget: float, asked: Callable[[], bool] = lambda: False) -> None:
        self.begin, self.budget, self.asked = time.monotonic(), budget, asked
        self.cut: list[str] = []

    @property
    def used(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self.begin

    def stop(self) -> bool:
        """Whether no further simulation should begin."""
        return self.asked() or self.used > self.budget

    def late(self, share: float) -> bool:
        """Whether so much of the time is gone."""
        return self.used > share * self.budget

    def allows(self, what: str) -> bool:
        """Whether there is time for it; what there is none for is noted."""
        if self.stop():
            self.leave_out(what)
            return False
        return True

    def leave_out(self, what: str) -> None:
        """Note what was not done."""
        self.cut.append(what)


def _nobody(_: str) -> None:
    """Nobody is told."""


@dataclass(frozen=True, eq=False)
class Work:
    """A clock, how many threads simulate side by side, and who is told what is tried."""

    clock: Clock
    threads: int = 1
    tell: Callable[[str], None] = _nobody

    @property
    def stop(self) -> Callable[[], bool]:
        """Asked between two simulations."""
        return self.clock.stop

    def side_by_side(self, work: Callable[[T], R], several: Sequence[T]) -> list[R]:
        """Results in order; the core computes without holding the interpreter."""
        if self.threads == 1 or len(several) < 2:
            return list(map(work, several))
        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(work, several))
