"""A line of progress that says as data, too, what is tried and what is best so far.

Whoever is told prints it as the text that it is, or takes its parts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

__all__ = ["Counted", "Said"]


class Said(str):
    """What a search says of itself.

    tried:  what is tried now
    leader: the best explanation so far, with how good it is; empty while there is none
    """

    tried: str
    leader: str

    def __new__(cls, tried: str, leader: str = "") -> Self:
        """Say both in one line."""
        own = super().__new__(cls, f"{tried}; best so far {leader}" if leader else tried)
        own.tried, own.leader = tried, leader
        return own


_EVERY = 20  # replays: a second of the longest records, a tenth of one of short ones


class Counted:
    """Tells a line, and the same with how much is done from time to time, counted and not clocked.

    tell: who is told
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell, self._last, self._told = tell, Said(""), 0

    def __call__(self, what: str) -> None:
        """Tell another line."""
        self._last = what if isinstance(what, Said) else Said(what)
        self._tell(what)

    def replays(self, done: int) -> None:
        """Tell it again, so many replays being done."""
        if self._last and done >= self._told + _EVERY:
            self._told = done
            self._tell(Said(f"{self._last.tried}, {done} replays", self._last.leader))
