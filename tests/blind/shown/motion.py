"""Jerk-limited commands: moves from rest to rest with dwells between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Jerks = list[tuple[float, float]]


def move(start: float, distance: float, v: float, a: float, j: float) -> tuple[Jerks, float]:
    """(time, jerk) pieces of one move, and when it ends; `v` is reached if there is room."""
    sign, length = np.sign(distance), abs(distance)
    ramp = _ramp(v, a, j)
    if v * sum(ramp) > length:  # v is not reached: find the speed that is
        low, high = 0.0, v
        for _ in range(80):
            v = (low + high) / 2
            ramp = _ramp(v, a, j)
            low, high = (low, v) if v * sum(ramp) > length else (v, high)
    rise, flat = ramp[0], ramp[1]
    cruise = length / v - sum(ramp)
    times = np.cumsum([0, rise, flat, rise, cruise, rise, flat, rise]) + start
    jerks = sign * j * np.array([1, 0, -1, 0, -1, 0, 1, 0])
    return list(zip(times.tolist(), jerks.tolist(), strict=True)), float(times[-1])


def _ramp(v: float, a: float, j: float) -> tuple[float, float, float]:
    """Times of rising jerk, constant acceleration, falling jerk, from rest to v."""
    if v * j < a * a:
        return float(np.sqrt(v / j)), 0.0, float(np.sqrt(v / j))
    return a / j, v / a - a / j, a / j


def course(
    moves: Sequence[tuple[float, float, float, float]], dwells: Sequence[float]
) -> tuple[Jerks, float]:
    """Moves (distance, v, a, j) one after another; `dwells` before each and after the last."""
    pieces: Jerks = []
    t = dwells[0]
    for (distance, v, a, j), rest in zip(moves, dwells[1:], strict=True):
        own, t = move(t, distance, v, a, j)
        pieces += own
        t += rest
    return pieces, t
