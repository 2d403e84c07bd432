"""What goes wrong in the search for limit cycles."""

from __future__ import annotations

__all__ = ["CycleError"]


class CycleError(ValueError):
    """A limit cycle that can't be predicted or found; the message is one line."""
