"""Residual analysis: whether what a fitted machine leaves is noise (Ljung, ch. 16.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, drive_torque

_LONGEST = 400  # samples that the inflation sums over
_SURE = 4.0  # standard deviations of a sum of squares


@dataclass(frozen=True)
class MissingTorque:
    """What an equation of motion lacks, RMS over the samples, N*m in the frame of its body.

    rms:         of the torque of unknown course that the filter asks for
    share:       of the drives' torque there
    """

    rms: float
    share: float


def missing_torque(core: Any, grey: GreyBox, f: Fitted) -> dict[str, MissingTorque]:
    """Equation -> torque of unknown course that a fitted machine still asks for."""
    drives = drive_torque(core, grey.records)
    records = grey.filtered(f.point, f.gains)
    found = {}
    for body in f.noise.torque:
        course = np.concatenate([r.torques[body] for r in records])
        rms = float(np.sqrt(np.mean(course**2)))
        scale = drives.get(body, 0.0)
        found[body] = MissingTorque(rms, rms / scale if scale > 0.0 else 0.0)
    return found


def suffices(core: Any, grey: GreyBox, f: Fitted) -> bool:
    """Whether a machine asks for hardly any torque of unknown course."""
    return little(missing_torque(core, grey, f))


def white(f: Fitted) -> bool:
    """Whether the inflation is that of white innovations, as many as there are."""
    values = sum(r.size for r in f.point.residuals)
    scatter = _SURE * math.sqrt(2.0 * _LONGEST / values)
    return f.inflation <= max(threshold("white"), 1.0 + scatter)


def little(missing: dict[str, MissingTorque]) -> bool:
    """Whether no equation lacks a torque worth a law."""
    most = max((m.share for m in missing.values()), default=0.0)
    return most <= threshold("unexplained torque")
