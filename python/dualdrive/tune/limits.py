"""Limits of commanded motion as a control has them."""

from __future__ import annotations

from dataclasses import dataclass

from dualdrive.motion import Motion

__all__ = ["MotionLimits"]


@dataclass(frozen=True)
class MotionLimits:
    """Of the table: acceleration, rad/s² (m/s²), and jerk, rad/s³ (m/s³). MD32300, MD32431."""

    acceleration: float
    jerk: float

    @classmethod
    def of(cls, motion: Motion) -> MotionLimits | None:
        """Those a motion was made with; None where it has none, a step say."""
        a, j = motion.arguments.get("a"), motion.arguments.get("j")
        return cls(a, j) if a is not None and j is not None else None
