"""What goes wrong with tuning and drive parameters."""

from __future__ import annotations

__all__ = ["TuneError"]


class TuneError(ValueError):
    """Something that can't be tuned, read or set; the message is one line and says what to do."""
