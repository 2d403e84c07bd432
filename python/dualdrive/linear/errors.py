"""What goes wrong with a linear model or a frequency response."""

from __future__ import annotations

__all__ = ["LinearError"]


class LinearError(ValueError):
    """A linear model that can't be made; the message is one line and says what to do."""
