"""Residual analysis: whether what a model leaves is white, and free of the input.

L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section 16.6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Correlation", "residual_correlations"]

Array = NDArray[np.float64]

_NORMAL_99 = 2.576  # of the standard normal distribution, two-sided 99 %


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlations of one residual over lags in s; arrays of shape (k,).

    auto:       with itself, 1 at lag 0
    auto_band:  99 % band were the residual white
    cross:      with the input `lags` earlier (negative lags: later, as feedback has it)
    cross_band: 99 % band were residual and input independent
    """

    record: str
    name: str
    lags: Array
    auto: Array
    auto_band: float
    cross_lags: Array
    cross: Array
    cross_band: float


def residual_correlations(
    record: str, name: str, t: Array, residual: Array, input_: Array, most: int = 60
) -> Correlation:
    """Correlations of a residual at `most` lags on either side.

    The lags are samples apart, but in a record of more than 20 000 samples so many samples that
    they reach a hundredth of the record: neighbours of a fast recorder tell nothing new.

    Args:
        record: its name, for the result.
        name: of the quantity.
        t: times in s, shape (n,), even.
        residual: shape (n,).
        input_: what the machine was told, shape (n,): the commanded speed.
        most: lags on either side.

    """
    e, u = residual - residual.mean(), input_ - input_.mean()
    n = len(e)
    step = max(1, n // (100 * most) if n > 20_000 else 1)
    shifts = step * np.arange(min(most, max(n // 4 // step, 1)) + 1)
    dt = float(t[-1] - t[0]) / max(n - 1, 1)
    ree: Array = np.array([np.dot(e[k:], e[: n - k]) / n for k in shifts])
    ruu = np.array([np.dot(u[k:], u[: n - k]) / n for k in shifts])
    later = np.array([np.dot(e[k:], u[: n - k]) / n for k in shifts])
    earlier = np.array([np.dot(e[: n - k], u[k:]) / n for k in shifts[:0:-1]])
    scale = math.sqrt(ree[0] * ruu[0])
    auto = np.asarray(ree / ree[0] if ree[0] > 0 else np.zeros_like(ree))
    both_ways = np.concatenate([earlier, later])
    cross = np.asarray(both_ways / scale if scale > 0 else np.zeros_like(both_ways))
    # variance of the cross-correlation of independent signals: sum of the products of their own
    own = ruu / ruu[0] if ruu[0] > 0 else np.zeros_like(ruu)
    both = 1.0 + 2.0 * step * float(np.dot(auto[1:], own[1:]))
    return Correlation(
        record,
        name,
        np.asarray(shifts * dt, dtype=np.float64),
        auto,
        _NORMAL_99 / math.sqrt(n),
        np.concatenate([-shifts[:0:-1], shifts]) * dt,
        cross,
        _NORMAL_99 * math.sqrt(max(both, 1.0) / n),
    )
