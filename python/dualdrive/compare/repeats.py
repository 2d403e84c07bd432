"""Where the command repeats, what differs from period to period is noise, whatever its colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ALIKE = 1e-3  # of the command's spread, by which periods may differ
_UNLIKE = 0.3  # by which it must have changed in between
_SHORTEST = 16  # samples
_EVEN = 0.05  # of a step, by which an even clock's steps may differ


@dataclass(frozen=True)
class Period:
    """A command that repeats: `count` periods of `length` samples from sample `start` on."""

    start: int
    length: int
    count: int
    seconds: float

    @property
    def words(self) -> str:
        """``4 periods of 2.5 s``."""
        return f"{self.count} periods of {self.seconds:.4g} s"


def period_of(t: Array, reference: Array) -> Period | None:
    """The shortest period of a command that fits twice and more into the record, if there is one.

    A command that goes on by the same amount each period (full turns) repeats, too. The first of
    three and more periods is left out: the machine may still settle. Times must be even.
    """
    steps = np.diff(t)
    if len(t) < 2 * _SHORTEST or np.any(
        np.abs(steps - np.median(steps)) > _EVEN * np.median(steps)
    ):
        return None
    moving = np.flatnonzero(np.diff(reference) != 0.0)
    if len(moving) < 2 * _SHORTEST:
        return None
    first, last = int(moving[0]), int(moving[-1]) + 2
    own = reference[first:last]
    length = _length(own)
    # standing between two periods belongs to the last one as well
    if length is None:
        return None
    whole = (len(reference) - first) // length
    while whole >= 2 and not _repeats(reference[first : first + whole * length], length):
        whole -= 1
    if whole < 2:
        return None
    skipped = 1 if whole > 2 else 0
    seconds = length * float(np.median(steps))
    return Period(first + skipped * length, length, whole - skipped, seconds)


def _length(own: Array) -> int | None:
    """The first lag at which the differences of the signal with itself no longer vary."""
    n = len(own)
    rest = own - own.mean()
    size = 1 << (2 * n - 1).bit_length()
    product = np.fft.irfft(np.abs(np.fft.rfft(rest, size)) ** 2, size)[:n]
    squares = np.concatenate([[0.0], np.cumsum(rest**2)])
    sums = np.concatenate([[0.0], np.cumsum(rest)])
    lags = np.arange(_SHORTEST, n // 2 + 1)
    count = n - lags
    difference = (sums[n] - sums[lags]) - sums[n - lags]
    square = (squares[n] - squares[lags]) + squares[n - lags] - 2.0 * product[lags]
    spread = np.sqrt(np.maximum(square / count - (difference / count) ** 2, 0.0))
    scale = float(np.std(own))
    apart = np.flatnonzero(spread > _UNLIKE * scale)
    if not len(apart):
        return None
    near = np.flatnonzero(spread[apart[0] :] < 10.0 * _ALIKE * scale) + apart[0]
    for k in near.tolist():
        if _repeats(own, int(lags[k])):
            return int(lags[k])
    return None


def _repeats(own: Array, length: int) -> bool:
    difference = own[length:] - own[:-length]
    return bool(np.max(np.abs(difference - np.median(difference))) <= _ALIKE * np.ptp(own))


def spread_of_periods(values: Array, period: Period) -> float:
    """RMS deviation of a channel from its mean over the periods, advances taken off."""
    end = period.start + period.count * period.length
    folded = values[period.start : end].reshape(period.count, period.length)
    folded = folded - folded.mean(axis=1, keepdims=True)
    left = folded - folded.mean(axis=0)
    return float(np.sqrt(np.sum(left**2) / ((period.count - 1) * period.length)))
