"""Noise as it is: coloured, and larger where a jittering clock meets a fast signal.

Each series' noise is an autoregression driven by innovations whose variance grows with the square
of the signal's rate. Filtered by the inverse autoregression and divided by the innovations' size,
noise becomes white and least squares become likelihoods.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.confront import Series

Array = NDArray[np.float64]

ORDERS = (0, 1, 2, 3, 4, 6, 8)
_FEW, _LONGEST = 8, 0.1  # samples; correlation time, as a share of a record
_SETTLED = 0.1  # change of the noise's size, relative
_PAUSE = 1.5  # sampling intervals: a longer step in time starts a new stretch


@dataclass(frozen=True, eq=False)
class Whitener:
    """Of one series.

    ar:    coefficients of e_k = sum ar_j e_{k-j} + innovation, shape (p,)
    scale: RMS of the innovations, shape (n,), times the root of `alike`
    keep:  samples that count, shape (n,); those with too little before them do not
    alike: how many samples count as one, where `ar` leaves them correlated: 1 or more
    """

    ar: Array
    scale: Array
    keep: NDArray[np.bool_]
    alike: float = 1.0

    def __call__(self, values: Array) -> Array:
        """White rows from values of shape (n,) or (n, k); zero where a sample does not count."""
        white = values.astype(np.float64, copy=True)
        for lag, a in enumerate(self.ar, 1):
            white[lag:] -= a * values[:-lag]
        shape = (-1, *([1] * (values.ndim - 1)))
        result: Array = np.where(self.keep, 1.0 / self.scale, 0.0).reshape(shape) * white
        return result


def plain(series: Sequence[Series]) -> list[Whitener]:
    """White noise as large as each series' floor: a first guess."""
    none = np.zeros(0)
    return [Whitener(none, np.full(len(s.t), _size(s)), s.keep) for s in series]


def sized(series: Sequence[Series], noise: Sequence[Array]) -> list[Whitener]:
    """White noise as large as what is left: before anything better is known of its colour.

    What a wrong model leaves is alike from sample to sample. It is not filtered, as noise would be,
    but counted as the few independent samples that it is: else a record on which the machine hunts
    out of step would drag the numbers away from what the steadier ones tell, beyond all priors.
    """
    return [_sized(s, e) for s, e in zip(series, noise, strict=True)]


def _sized(series: Series, noise: Array) -> Whitener:
    own = noise[series.keep]
    alike = count_as_one(own)
    scale = np.sqrt(alike) * max(rms(own), _size(series))
    return Whitener(np.zeros(0), np.full(len(series.t), scale), series.keep, alike)


def count_as_one(left: Array) -> float:
    """How many samples count as one: one plus twice the sum of the autocorrelations."""
    from dualdrive.identify.coloured import correlation_time

    if len(left) <= _FEW:
        return 1.0
    return 1.0 + 2.0 * min(correlation_time(left), _LONGEST * len(left))


def settled(first: Sequence[float], second: Sequence[float]) -> bool:
    """Whether sizes of noise, one per series, are so much alike that another round is idle."""
    a, b = np.array(first) + 1e-300, np.array(second) + 1e-300
    return bool(np.all(np.abs(np.log(b / a)) < _SETTLED))


def fitted(series: Sequence[Series], noise: Sequence[Array]) -> list[Whitener]:
    """From stand-ins for the noise, one array of shape (n,) per series."""
    return [_fitted(s, e) for s, e in zip(series, noise, strict=True)]


def _fitted(series: Series, noise: Array) -> Whitener:
    keep = _with_past(series, max(ORDERS))
    size = _size(series)
    if keep.sum() < 20 * max(ORDERS):
        scale = max(rms(noise[keep]), size)
        return Whitener(np.zeros(0), np.full(len(noise), scale), keep)
    ar = _autoregression(noise, keep)
    left = noise.astype(np.float64, copy=True)
    for lag, a in enumerate(ar, 1):
        left[lag:] -= a * noise[:-lag]
    # below the quantisation of its sensor, or arithmetic, no series is believed
    least = 0.05 * size
    return Whitener(ar, np.maximum(_scale(left, series.rate, keep), least), keep)


def _autoregression(noise: Array, keep: NDArray[np.bool_]) -> Array:
    """Least squares over every order; the one with the least Akaike criterion."""
    top = max(ORDERS)
    n = len(noise)
    rows = np.flatnonzero(keep)
    lagged = np.stack([noise[rows - lag] for lag in range(1, top + 1)], axis=1)
    target = noise[rows]
    gram, right = lagged.T @ lagged, lagged.T @ target
    square = float(target @ target)
    best, least = np.zeros(0), np.inf
    for order in ORDERS:
        ar = np.zeros(0)
        rest = square
        if order:
            part = gram[:order, :order] + 1e-10 * gram[0, 0] * np.eye(order)
            ar = np.linalg.solve(part, right[:order])
            rest = max(square - float(ar @ right[:order]), 1e-12 * square)
        criterion = n * np.log(rest / len(rows) + 1e-300) + 2 * order
        if criterion < least:
            best, least = ar, criterion
    return best


def _scale(left: Array, rate: Array, keep: NDArray[np.bool_]) -> Array:
    """RMS of innovations as s0^2 + (jitter * rate)^2, both parts not negative, shape (n,)."""
    square, fast = left[keep] ** 2, rate[keep] ** 2
    whole = float(np.mean(square)) + 1e-300
    spread = float(np.mean(fast))
    if spread <= 0.0:
        return np.full(len(left), np.sqrt(whole))
    slow = fast <= np.median(fast)
    at_slow, at_fast = float(np.mean(square[slow])), float(np.mean(square[~slow]))
    gap = float(np.mean(fast[~slow]) - np.mean(fast[slow]))
    # a clear rise only: twice its own standard error
    error = float(np.std(square)) * np.sqrt(4.0 / len(square))
    if gap <= 0.0 or at_fast - at_slow < 2.0 * error:
        return np.full(len(left), np.sqrt(whole))
    jitter = (at_fast - at_slow) / gap
    base = max(at_slow - jitter * float(np.mean(fast[slow])), 0.1 * at_slow)
    result: Array = np.sqrt(base + jitter * rate**2)
    return result


def _with_past(series: Series, past: int) -> NDArray[np.bool_]:
    """Kept samples whose `past` predecessors are kept too, without a pause in between."""
    n = len(series.t)
    step = np.diff(series.t)
    fresh = np.concatenate([[True], step > _PAUSE * np.median(step)]) | ~series.keep
    last = np.maximum.accumulate(np.where(fresh, np.arange(n), -1))
    found: NDArray[np.bool_] = series.keep & (np.arange(n) - last >= past)
    return found


def rms(values: Array) -> float:
    """Root of the mean square; zero of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _size(series: Series) -> float:
    return max(series.floor, 1e-6 * series.spread, 1e-300)
