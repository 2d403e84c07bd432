"""Angles that wrap after a turn, counters that are set back, jumps that are neither."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .channels import Channel
from .log import Recorder
from .names import MEASURED_ANGLES

__all__ = ["mend_angles"]

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_LONE = 8.0  # a jump is this many times larger than the usual and the neighbouring steps
_NEAR = 5  # neighbouring steps on each side


def mend_angles(channel: Channel, rows: Indices, breaks: Indices, recorder: Recorder) -> list[int]:
    """Unwrap an angle, deal with counters set back, and name jumps.

    breaks: samples that begin a segment; a jump across a pause is not judged
    Returns the samples at which a new segment begins because a counter was set back.
    """
    rule = channel.rule
    if rule.wrap is not False:
        _unwrap(channel, rows, recorder)
    if channel.name not in MEASURED_ANGLES or len(channel.values) < 2 * _NEAR:
        return []
    jumps = _lone_jumps(channel.values, breaks)
    resets = jumps[_back_at_start(channel.values, jumps)]
    others = np.setdiff1d(jumps, resets)
    if others.size:
        size = np.abs(np.diff(channel.values))[others - 1].max()
        message = f"{channel.column}: {channel.name} jumps by up to {size:.4g} rad; kept"
        recorder.add("jump", message, rows[others])
    if not resets.size or rule.reset == "keep":
        return []
    if rule.reset == "continue":
        recorder.add("reset", f"{channel.column}: counted on", rows[resets])
        _count_on(channel, resets)
        return []
    recorder.add("reset", f"{channel.column}: set back, a new segment begins", rows[resets])
    return [int(i) for i in resets]


def _unwrap(channel: Channel, rows: Indices, recorder: Recorder) -> None:
    """Undo the turns of a channel that stays within one period and jumps by nearly all of it."""
    if channel.turn is not None:
        turns = [channel.turn]
    elif channel.name in MEASURED_ANGLES or channel.name == "theta_ref":
        turns = [2 * math.pi]
    else:
        return
    steps = np.diff(channel.values)
    for turn in turns:
        over = np.abs(steps) > (0.5 if channel.turn is not None else 0.75) * turn
        if not over.any():
            continue
        left = np.abs(steps - turn * np.round(steps / turn))
        if channel.turn is None and (np.ptp(channel.values) > 1.01 * turn or left.max() > turn / 4):
            continue  # not the picture of an angle read modulo one turn
        channel.values = np.unwrap(channel.values, period=turn)
        message = f"{channel.column}: {channel.name} unwrapped at {turn:.6g} rad"
        recorder.add("wrapped", message, rows[1:][over])
        return


def _lone_jumps(values: Floats, breaks: Indices) -> Indices:
    """Samples reached by a step far beyond the usual one and beyond all its neighbours."""
    steps = np.abs(np.diff(values))
    steps[np.asarray(breaks, dtype=np.int64) - 1] = 0.0
    moving = steps[steps > 0]
    if not moving.size:
        return np.empty(0, dtype=np.int64)
    candidates = np.flatnonzero(steps > _LONE * np.quantile(moving, 0.95, method="lower"))
    lone = []
    for k in candidates:
        around = np.r_[steps[max(k - _NEAR, 0) : k], steps[k + 1 : k + 1 + _NEAR]]
        if steps[k] > _LONE * around.max():
            lone.append(k + 1)
    return np.array(lone, dtype=np.int64)


def _back_at_start(values: Floats, jumps: Indices) -> NDArray[np.bool_]:
    """Jumps that land at zero or where the counter began."""
    if not jumps.size:
        return np.empty(0, dtype=bool)
    size = np.abs(values[jumps] - values[jumps - 1])
    home = np.minimum(np.abs(values[jumps]), np.abs(values[jumps] - values[0]))
    return np.asarray(home < 0.02 * size, dtype=bool)


def _count_on(channel: Channel, resets: Indices) -> None:
    """Add back what each reset took away; the step over the reset itself counts as none."""
    steps = np.diff(channel.values, prepend=channel.values[0])
    steps[resets] = 0.0
    channel.values = channel.values[0] + np.cumsum(steps)
