"""Stamps that jitter about an even clock: a recorder took its samples evenly and stamped them late.

The commanded motion tells which it was. Read at the right times it is smooth; read at stamps that
jitter it is as rough as its speed times the jitter, and a feed-forward turns that into current.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.traces import Trace

Array = NDArray[np.float64]

_JITTER = 0.3  # of a sampling interval: beyond it the clock has pauses, not jitter
_ROUNDING = 1e-3  # of a sampling interval: as in `compare.clocks`
_SURE = 3.0  # standard errors of a clock
_CLEARLY = 0.7  # of the roughness on the other clock


def evened(trace: Trace) -> tuple[Trace, float]:
    """The trace on an even clock unless its motion says that it was sampled unevenly.

    Returns:
        The trace, and the RMS jitter that was taken out, s (0 where it stays as it is).

    """
    t = trace.t
    if len(t) < 32 or len(getattr(trace, "breaks", ())):
        return trace, 0.0
    k = np.arange(len(t), dtype=np.float64)
    step, first = np.polyfit(k, t, 1)
    left = float(np.std(t - (first + step * k)))
    # standard errors of a straight line's slope and of its value at the first of n points
    error = left * np.sqrt(12.0 / len(t) ** 3)
    step = _as_set(float(step), float(error))
    first = float(np.mean(t - step * k))
    first = 0.0 if abs(first) < _SURE * 2.0 * left / np.sqrt(len(t)) else first
    even = first + step * k
    jitter = t - even
    size = float(np.std(jitter))
    if size <= 1e-6 * step or float(np.max(np.abs(jitter))) > _JITTER * step:
        return trace, 0.0
    for name in ("theta_ref", "theta_m", "theta_1"):
        if name in trace:
            stamped, evenly = _roughness(t, trace[name]), _roughness(even, trace[name])
            # where nothing tells, as where all was slow, a converter's own clock is the likelier;
            # what is no more than the rounding of stamps stays as every other verb reads it
            told = evenly < _CLEARLY * stamped
            likelier = size > _ROUNDING * step and not stamped < _CLEARLY * evenly
            return (replace(trace, t=even), size) if told or likelier else (trace, 0.0)
    return trace, 0.0


def _as_set(step: float, error: float) -> float:
    """The step of a rate in round hertz, as rates are set, unless the stamps tell it apart."""
    rate = float(f"{1.0 / step:.4g}")
    return 1.0 / rate if abs(1.0 / rate - step) < _SURE * error else step


def _roughness(t: Array, values: Array) -> float:
    """RMS error of foretelling every other sample from its neighbours, where it moves fast."""
    from scipy.interpolate import CubicSpline

    odd = slice(1, len(t) - 1, 2)
    off = CubicSpline(t[::2], values[::2])(t[odd]) - values[odd]
    speed = np.abs(np.gradient(values, t))[odd]
    fast = speed > 0.5 * float(np.max(speed))
    return float(np.sqrt(np.mean(off[fast] ** 2))) if fast.any() else 0.0
