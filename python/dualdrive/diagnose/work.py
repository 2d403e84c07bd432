"""What a search works with: its time, its threads, and who is told what it tries."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeVar

from dualdrive.said import Said

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
        """Whether nothing further should begin."""
        return self.asked() or self.used > self.budget

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


class Leader:
    """The best explanation so far, in words that go with whatever is tried after it."""

    def __init__(self) -> None:
        self._cost, self._said = math.inf, ""

    def after(self, tried: str) -> Said:
        """What is tried, and what is best so far."""
        return Said(tried, self._said)

    def meets(self, label: str, cost: float, remark: str) -> None:
        """Take what was refitted, where nothing before it was judged or cost less.

        label: of the explanation; cost: of any scale, less is better; remark: how good it is
        """
        if cost < self._cost:
            self._cost, self._said = cost, f"{label}, {remark}"

    def judged(self, label: str, remark: str) -> None:
        """Take what is best once its numbers are counted too; costs of refits say no more then."""
        self._cost, self._said = -math.inf, f"{label}, {remark}"


def misfit_left(chi: float, alone: float) -> str:
    """How good an explanation is that leaves so much of the chi^2 of the machine without it."""
    return f"{100.0 * math.sqrt(chi / alone) if alone > 0.0 else 100.0:.3g} % of the misfit left"


@dataclass(frozen=True, eq=False)
class Work:
    """A clock, how many threads work side by side, and who is told what is tried."""

    clock: Clock
    threads: int = 1
    told: Callable[[str], None] = _nobody
    leader: Leader = field(default_factory=Leader)

    def tell(self, what: str) -> None:
        """Say what is tried, and what is best so far."""
        self.told(self.leader.after(what))

    @property
    def stop(self) -> Callable[[], bool]:
        """Asked between two evaluations."""
        return self.clock.stop

    def side_by_side(self, work: Callable[[T], R], several: Sequence[T]) -> list[R]:
        """Results in order; the core computes without holding the interpreter."""
        if self.threads == 1 or len(several) < 2:
            return list(map(work, several))
        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(work, several))
