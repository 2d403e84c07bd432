"""Pauses and uneven steps of a time base."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .log import Recorder
from .mapping import TimeRule
from .mapping_file import duration

__all__ = ["GAP_STEPS", "find_gaps", "gap_limit", "note_jitter"]

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

GAP_STEPS = 10  # a pause is a step this many times longer than the median step
_UNEVEN = 0.01  # steps that differ from the median by less are even


def gap_limit(t: Floats, rule: TimeRule) -> float:
    """The longest step that is not a pause, in seconds."""
    if rule.gap:
        return duration(rule.gap, "time.gap")
    return GAP_STEPS * float(np.median(np.diff(t))) if len(t) > 1 else 0.0


def find_gaps(t: Floats, limit: float) -> NDArray[np.int64]:
    """Indices of the samples that follow a pause."""
    return np.asarray(np.flatnonzero(np.diff(t) > limit * (1 + 1e-9)) + 1, dtype=np.int64)


def note_jitter(t: Floats, rows: Rows, limit: float, recorder: Recorder) -> None:
    """Say how uneven the steps are; the time stamps stay as they are."""
    steps = np.diff(t)
    inside = steps <= limit * (1 + 1e-9)
    if np.count_nonzero(inside) < 2:
        return
    usual = float(np.median(steps[inside]))
    uneven = inside & (np.abs(steps - usual) > _UNEVEN * usual)
    if uneven.any():
        low, high = steps[inside].min(), steps[inside].max()
        share = 100 * np.count_nonzero(uneven) / np.count_nonzero(inside)
        message = (
            f"steps from {1e3 * low:.4g} to {1e3 * high:.4g} ms, median {1e3 * usual:.4g} ms, "
            f"{share:.2g} % of them off by more than 1 %; time stamps kept"
        )
        recorder.add("jitter", message, rows[1:][uneven])
