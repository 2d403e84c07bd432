"""Do angles and speeds tell the same story? A cheap way to catch a wrong unit or sign."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .log import Recorder

__all__ = ["PAIRS", "note_rates", "rate_ratio"]

Floats = NDArray[np.float64]

PAIRS = tuple((f"theta_{s}", f"omega_{s}") for s in ("ref", "m", "1", "2", "c1", "c2"))
_BLOCKS = 50  # angles are compared over this many stretches, longer than quantisation and delay
_CLEAR = 0.9  # correlation from which on the ratio means something
_AGREE = 1.25  # a slipping or filtered speed is off by less


def rate_ratio(t: Floats, theta: Floats, omega: Floats, breaks: NDArray[np.int64]) -> float | None:
    """Change of angle over integral of speed; 1 when they agree, None when it cannot be told."""
    if len(t) < 2 * _BLOCKS:
        return None
    pieces = 0.5 * (omega[1:] + omega[:-1]) * np.diff(t)
    moved = np.diff(theta)
    pieces[breaks - 1] = moved[breaks - 1] = 0.0  # nothing is known across a pause
    starts = np.arange(0, len(pieces), max(len(pieces) // _BLOCKS, 1))
    expected, found = np.add.reduceat(pieces, starts), np.add.reduceat(moved, starts)
    power = np.sqrt(np.dot(expected, expected) * np.dot(found, found))
    if power == 0 or abs(np.dot(expected, found)) < _CLEAR * power:
        return None
    return float(np.dot(expected, found) / np.dot(expected, expected))


def note_rates(
    t: Floats, channels: Mapping[str, Floats], breaks: NDArray[np.int64], recorder: Recorder
) -> None:
    """Name the pairs of angle and speed that do not fit together."""
    for theta, omega in PAIRS:
        if theta not in channels or omega not in channels:
            continue
        ratio = rate_ratio(t, channels[theta], channels[omega], breaks)
        if ratio is not None and not 1 / _AGREE < ratio < _AGREE:
            message = (
                f"{theta} changes by {ratio:.4g} times the integral of {omega}; "
                "check units and signs in the mapping"
            )
            recorder.add("rates", message)
