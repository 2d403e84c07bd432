"""Residual analysis: whether what a fitted machine leaves is noise (Ljung, ch. 16.6)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, drive_torque, least_noise

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


def suffices(
    core: Any, grey: GreyBox, f: Fitted, known: Mapping[str, MissingTorque] | None = None
) -> bool:
    """Whether a machine asks for hardly any torque of unknown course, or for none beyond doubt.

    known: its missing torque, where that is
    """
    missing = known or missing_torque(core, grey, f)
    lacking = [b for b, own in missing.items() if own.share > threshold("unexplained torque")]
    return not lacking or lost_without(core, grey, f, lacking) < threshold("gain")


def lost_without(core: Any, grey: GreyBox, f: Fitted, bodies: Sequence[str] | None = None) -> float:
    """-2 log L over the inflation that a machine loses without torques that it asks for.

    All else as it is: refitted it would lose less. Where the torques are none the loss is half the
    time nought, else a chi-squared of one degree of freedom each (Self, Liang, Journal of the
    American Statistical Association 82 (1987) 605-610). Infinite where innovations are so far from
    noise that they say nothing, or the filter is lost.

    Args:
        core: the machine of the data sheet.
        grey: the records.
        f: the machine, fitted.
        bodies: where the torques act; everywhere unless given.

    """
    bodies = list(f.noise.torque) if bodies is None else bodies
    if f.inflation > threshold("inflation"):
        return math.inf
    least = least_noise(core, grey.records, threshold("least torque")).torque
    torque = {body: least[body] if body in bodies else s for body, s in f.noise.torque.items()}
    [found] = grey.likelihoods(f.variant, [(f.point.theta, replace(f.noise, torque=torque))])
    if found is None:
        return math.inf
    return (found[0].minus_two_log - f.point.minus_two_log) / f.inflation


def needs_no_torque(core: Any, grey: GreyBox, f: Fitted) -> bool:
    """Whether a machine follows the records as well without any torque of unknown course."""
    return lost_without(core, grey, f) < threshold("gain")


def white(f: Fitted) -> bool:
    """Whether the inflation is that of white innovations, as many as there are."""
    values = sum(r.size for r in f.point.residuals)
    scatter = _SURE * math.sqrt(2.0 * _LONGEST / values)
    return f.inflation <= max(threshold("white"), 1.0 + scatter)
