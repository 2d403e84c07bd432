"""What the paragraphs of both kinds of diagnosis say alike: shares, numbers, what to mind."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from dualdrive.diagnose.result import Experiment, Shape
from dualdrive.estimation.thresholds import threshold

__all__ = [
    "HELPS",
    "as_described",
    "beyond_noise",
    "closing",
    "depends",
    "none_missing",
    "percent",
    "unfinished",
]

HELPS = 0.05  # of the unexplained error: what removes less does not help
_FEW = 3  # warnings that a paragraph can hold
_OF_NONE = 0.05  # share of the missing torque below which a coordinate tells nothing of it


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


def as_described(error: Mapping[str, float], kind: str = "error") -> str:
    """What to say of a machine whose numbers are right and that lacks nothing that has a name."""
    errors = (
        f"{kind} {percent(error.get('nominal'))}, sensors alone {percent(error.get('noise_floor'))}"
    )
    if beyond_noise(error, "nominal"):
        return (
            f"The machine as described leaves more than noise, but nothing can be named: {errors}."
        )
    return (
        f"The machine as described meets the records: {errors}. "
        "Nothing is missing that these records could show."
    )


def unfinished(refitted: str, floor: str) -> str:
    """A search that was cut is no answer."""
    return (
        "The search was stopped before every law had its turn: what follows is what was known "
        f"until then, and no verdict. Refitting the data sheet's numbers leaves {refitted}; "
        f"sensors alone {floor}."
    )


def depends(shapes: Sequence[Shape]) -> str:
    """What the missing torque depends on most, and what that looks like; empty: none was tried."""
    if not shapes:
        return ""
    s = shapes[0]
    if s.explained < _OF_NONE:
        return "The missing torque depends on none of the coordinates that were tried."
    share = f"{100 * s.explained:.0f} % of the missing torque of the {s.equation.replace('_', ' ')}"
    if s.coordinate == "direction":
        return f"{share} depends only on the sign of the speed, as dry friction does."
    return f"{share} depends only on the {s.coordinate}."


def closing(
    groups: Sequence[Sequence[str]],
    experiment: Experiment | None,
    command: str,
    warnings: Sequence[str],
) -> list[str]:
    """What can't be told apart, what to do, what to mind."""
    said = []
    if groups:
        said.append(f"These records can't tell apart: {'; '.join(', '.join(g) for g in groups)}.")
    if experiment is not None:
        said.append(
            f"To tell {' from '.join(experiment.separates)}, measure next: {experiment.name} "
            f"(expected distance {experiment.expected_distance:.0f}; 11 is enough)."
        )
    if command:
        said.append(f"To add it: {command}")
    if len(warnings) > _FEW:
        said.append(f"Mind the {len(warnings)} warnings about the records.")
    elif warnings:
        said.append(f"Mind: {'; '.join(w.rstrip('.') for w in warnings)}.")
    return said
