"""Samples where a body hardly moves: dry friction there takes any value within its limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.filtering import ANGLES, Piece
from dualdrive.identify.model import Balance

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SPEEDS = tuple(speed for speed, _ in ANGLES.values())


@dataclass(frozen=True)
class Standstill:
    """What is done near standstill, and what counts as such.

    Args:
        treatment: ``mask`` drops the samples; ``bound`` counts only what no friction within its
            limits explains; ``keep`` treats them like all others.
        share: a body stands still below this share of its record's highest speed,
        speed: or below this speed, in the body's own frame, rad/s.

    Raises:
        ValueError: another treatment, or a negative limit.

    """

    treatment: Literal["mask", "bound", "keep"] = "mask"
    share: float = 0.01
    speed: float | None = None

    def __post_init__(self) -> None:
        if self.treatment not in ("mask", "bound", "keep"):
            raise ValueError(f"Standstill: treatment {self.treatment!r} is not mask, bound or keep")
        if self.share < 0 or (self.speed is not None and self.speed < 0):
            raise ValueError("Standstill: share and speed must not be negative")

    def limits(self, parts: Sequence[Piece]) -> dict[str, float]:
        """The limit of every speed of a record, over all its pieces."""
        highest: dict[str, float] = {}
        for piece in parts:
            for speed in SPEEDS:
                if speed in piece.samples:
                    own = float(np.abs(piece.samples[speed]).max())
                    highest[speed] = max(highest.get(speed, 0.0), own)
        fixed = self.speed
        return {s: self.share * top if fixed is None else fixed for s, top in highest.items()}


def at_rest(
    equations: Sequence[str], samples: Mapping[str, Array], limits: Mapping[str, float]
) -> Flags:
    """Flags (equations, n) where the equation's body, or any in a total, is below its limit."""
    slow = {s: np.abs(samples[s]) < limit for s, limit in limits.items() if s in samples}
    anywhere = np.logical_or.reduce(list(slow.values()))
    return np.array([slow.get(f"omega_{equation}", anywhere) for equation in equations])


def outside_limits(
    moving: Balance, still: Flags, evaluate: Callable[[float], Balance]
) -> tuple[Balance, Array]:
    """The balance with only what friction cannot explain left at standstill.

    Just moving forwards and just moving backwards are the two ends of what dry friction can do:
    a balance that closes somewhere in between leaves nothing, else the nearer end counts.

    Args:
        moving: the balance as recorded.
        still: flags (equations, n).
        evaluate: the balance with every speed just above (+1) or just below (-1) zero.

    Returns:
        The balance, and (equations, n) how much of a constant torque it still shows, 0 or 1.

    """
    forward, backward = evaluate(1.0), evaluate(-1.0)
    upper = np.maximum(forward.residual, backward.residual)
    lower = np.minimum(forward.residual, backward.residual)
    left = np.maximum(lower, 0.0) + np.minimum(upper, 0.0)
    forward_is_nearer = (forward.residual < backward.residual) == (lower > 0)
    slope = np.where(forward_is_nearer[..., None], forward.jacobian, backward.jacobian)
    shown = np.where(still & (left == 0), 0.0, 1.0)
    bounded = replace(
        moving,
        residual=np.where(still, left, moving.residual),
        jacobian=np.where(still[..., None], slope, moving.jacobian) * shown[..., None],
    )
    return bounded, shown


def creeping(samples: Mapping[str, Array], sign: float) -> dict[str, Array]:
    """The samples with every speed at a vanishing fraction of its highest value."""
    slow = {
        s: np.full_like(samples[s], sign * 1e-9 * (np.abs(samples[s]).max() + 1e-300))
        for s in SPEEDS
        if s in samples
    }
    return {**samples, **slow}
