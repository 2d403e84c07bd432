"""How smooth a torque curve is: what in it is neither demanded by the motion nor slow.

Within one piece of the commanded motion, of constant jerk, the torque that a rigid machine needs
rises or falls: inertia takes a part linear in time, friction and tension move it one way. A
vibration turns back on itself. So each piece is fitted by the nearest monotone curve, rising or
falling, whichever is nearer in the sense of least squares (isotonic regression: Barlow,
Bartholomew, Bremner & Brunk 1972), and

    ripple = RMS over all pieces of (torque - its monotone fit)

It needs no corner frequency, is 0 for a curve without vibration, and A/sqrt(2) for a vibration of
amplitude A over many periods.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["ripple"]

_FEWEST = 3  # two points are always monotone


def ripple(t: ArrayLike, torque: ArrayLike, pieces: Sequence[float]) -> float:
    """RMS departure of a torque from monotone pieces, in the torque's unit.

    t:       times, increasing and even, s, shape (n,)
    torque:  shape (n,)
    pieces:  where a new piece of the motion begins, s; before the first one nothing is judged
    """
    times, values = np.asarray(t, float), np.asarray(torque, float)
    edges = np.searchsorted(times, [*pieces, np.inf])
    squares, count = 0.0, 0
    for begin, end in pairwise(edges):
        part = values[begin:end]
        if part.size >= _FEWEST:
            squares += min(_left(part), _left(-part))
        count += part.size
    return float(np.sqrt(squares / count)) if count else 0.0


def _left(values: NDArray[np.float64]) -> float:
    """Sum of squares left by the nearest rising curve."""
    from scipy.optimize import isotonic_regression

    return float(np.sum((values - isotonic_regression(values).x) ** 2))
