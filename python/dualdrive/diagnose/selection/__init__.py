"""Which laws the records ask for: refits, forward selection, the noise that each leaves."""

from __future__ import annotations

from dualdrive.diagnose.selection.fitted import EFFORTS, Effort, Fitted, Selection
from dualdrive.diagnose.selection.parts import is_joint
from dualdrive.diagnose.selection.residual_analysis import (
    MissingTorque,
    lost_without,
    missing_torque,
    suffices,
    white,
)
from dualdrive.diagnose.selection.search import select

__all__ = [
    "EFFORTS",
    "Effort",
    "Fitted",
    "MissingTorque",
    "Selection",
    "is_joint",
    "lost_without",
    "missing_torque",
    "select",
    "suffices",
    "white",
]
