"""What ISO 230-2 asks of a test: how many targets, how often, and what may be evaluated.

Source: ISO 230-2:2014 (GB/T 17421.2), on target positions and on evaluation; clause 6.2 for travel
beyond 360 degrees or 2 m.
"""

from __future__ import annotations

import math
from typing import Final

__all__ = ["REPEATS", "IndexingError", "evaluated_once", "least_targets", "remarks"]

#: approaches of every target from either side
REPEATS: Final = 5
#: up to this travel every target is approached REPEATS times; beyond, once: rad, m
_REPEATED: Final = {"rad": math.tau, "m": 2.0}
_SLACK: Final = 1e-9


class IndexingError(ValueError):
    """A test that can't be evaluated, or a machine that can't make it. One line."""


def least_targets(unit: str, travel: float) -> int:
    """The number of targets asked for at least, by the travel in rad or m; 1 in any other unit."""
    if unit == "rad":
        quarter = math.pi / 2 * (1 + _SLACK)
        return 3 if travel <= quarter else 5 if travel <= 2 * quarter else 8
    if unit == "m":  # five per metre, and never fewer than five
        return max(5, math.ceil(5 * travel * (1 - _SLACK)))
    return 1


def evaluated_once(unit: str, travel: float) -> bool:
    """Whether the travel is so long that one approach is asked for, and no spread evaluated."""
    return unit in _REPEATED and travel > _REPEATED[unit] * (1 + _SLACK)


def remarks(unit: str, travel: float, targets: int, repeats: int) -> list[str]:
    """Where a test departs from what the standard asks, in words; empty where it does not."""
    said = []
    asked = least_targets(unit, travel)
    if targets < asked:
        said.append(f"{targets} targets; the standard asks for {asked} or more on this travel")
    if evaluated_once(unit, travel):
        limit = "360 degrees" if unit == "rad" else "2 m"
        said.append(f"travel beyond {limit}: the standard evaluates no s, R and A there")
    elif repeats == 1:
        said.append("one approach per target and side: no spread, so no s, R and A")
    elif repeats < REPEATS:
        said.append(f"{repeats} approaches per target and side; the standard asks for {REPEATS}")
    return said
