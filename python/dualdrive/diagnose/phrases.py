"""What paragraph, headline and ladder say alike of errors and of what is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping

from dualdrive.estimation.thresholds import threshold

__all__ = ["beyond_noise", "none_missing", "percent"]


def percent(share: float | None) -> str:
    """Three digits, a question mark where it is not known."""
    return "?" if share is None or not math.isfinite(share) else f"{100 * share:.3g} %"


def beyond_noise(error: Mapping[str, float], which: str) -> bool:
    """Whether a machine leaves more than sensors do, though no effect has a name.

    error: headline errors of a diagnosis; which: of them, that of the machine
    """
    left, floor = (error.get(name, math.nan) for name in (which, "noise_floor"))
    return left > threshold("beyond the floor") * floor


def none_missing(error: Mapping[str, float]) -> str:
    """What to say of effects beside numbers that are off: that none is missing, or none shows."""
    more = beyond_noise(error, "refitted")
    return "No missing effect can be named" if more else "No effect is missing"
