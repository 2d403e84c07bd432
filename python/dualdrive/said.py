"""A line of progress that says as data, too, what is tried and what is best so far.

Whoever is told prints it as the text that it is, or takes its parts.
"""

from __future__ import annotations

from typing import Self

__all__ = ["Said"]


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
