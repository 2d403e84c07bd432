"""What goes wrong in the search for limit cycles."""

from __future__ import annotations

__all__ = ["CycleError", "NoCycleError"]


class CycleError(ValueError):
    """A limit cycle that can't be asked for like this; the message is one line."""


class NoCycleError(CycleError, RuntimeError):
    """A search that was made and found no cycle; the message says what was found instead."""
