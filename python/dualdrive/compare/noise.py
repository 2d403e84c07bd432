"""What a sensor alone would leave: a floor under every error, read from the record itself.

Where the command repeats, what differs from one period to the next is noise
(:mod:`dualdrive.compare.repeats`). Else it can only be told from signal where the signal is not.
While the machine stands, all that moves is noise, coloured or not. While it moves, the spectrum of
white noise lies bare near half the sampling rate; noise that a filter has coloured reads too low
there, and vibration up there reads as noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.repeats import Period, spread_of_periods

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_BAND = (0.6, 0.95)  # of half the sampling rate: where the floor of the spectrum is read
_SHORT = 256  # samples; fewer make no spectrum
_WINDOW, _LONG = 0.25, 0.5  # s
_FEWEST, _LEAST = 4, 2  # windows at standstill: as many as wanted, and as will do
_HIDDEN = 0.5  # of the floor: a channel that stands rounded to one step hides its noise
_CALM = 1.5  # times the spread in the calmest of them: more is motion
_ORDER = 4  # of the differences that take a slow signal out of a short record


@dataclass(frozen=True)
class NoiseFloor:
    """RMS noise of one channel in SI, and in words how it was obtained."""

    rms: float
    how: str


def noise_floor(
    t: Array,
    values: Array,
    still: Flags | None = None,
    *,
    period: Period | None = None,
    jitter: float = 0.0,
) -> NoiseFloor:
    """Estimate the noise of a channel from one record.

    From its periods where the command repeats; else the larger of: the spread about a parabola in
    quarter-second windows at standstill (median of the windows); white noise as tall as the
    spectrum between 0.6 and 0.95 of half the sampling rate (Welch, Hann windows, median over the
    band), or in a short record the fourth differences. Never less than the rounding step over √12,
    or than jitter makes.

    Args:
        t: seconds, shape (n,).
        values: shape (n,).
        still: samples at which the machine stands, shape (n,).
        period: of the command, where it repeats.
        jitter: RMS noise that the clock makes of this channel's speed.

    """
    found = [NoiseFloor((step := rounding_step(values)) / np.sqrt(12.0), f"rounding to {step:.3g}")]
    if jitter > 0.0:
        found.append(NoiseFloor(jitter, "jitter of the clock times speed"))
    if period is not None:
        found.append(NoiseFloor(spread_of_periods(values, period), period.words))
        return max(found, key=lambda floor: floor.rms)
    if len(values) >= _SHORT:
        found.append(NoiseFloor(_above_the_signal(t, values), "spectrum above the signal"))
    elif len(values) > 2 * _ORDER:
        rough = float(np.std(np.diff(values, n=_ORDER))) / np.sqrt(comb(2 * _ORDER, _ORDER))
        found.append(NoiseFloor(rough, "differences of neighbours"))
    if still is not None and (quiet := _at_standstill(t, values, still)):
        found.append(NoiseFloor(quiet, "standstill"))
    return max(found, key=lambda floor: floor.rms)


def like_noise(t: Array, values: Array, still: Flags | None, random: np.random.Generator) -> Array:
    """A stretch of noise such as a channel's, shape (n,): as coloured as it is at standstill.

    Pieces of the record at standstill, straight lines taken off, in random order; white noise as
    large as the floor where the machine hardly stands, or its rounding hides what there is.
    """
    floor = noise_floor(t, values).rms
    for length in (_LONG, _WINDOW):
        size = max(24, round(length / float(np.median(np.diff(t)))))
        starts = [] if still is None else _quiet(still, size)
        if len(starts) >= _FEWEST:
            break
    if len(starts) < _LEAST:
        return random.normal(0.0, floor, len(t))
    basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, size), 1)
    pieces = np.stack([values[k : k + size] for k in starts], axis=1)
    left = pieces - basis @ np.linalg.lstsq(basis, pieces, rcond=None)[0]
    # a drive that still settles, or hunts, is no noise
    spread = np.std(left, axis=0)
    calm = left[:, spread <= _CALM * max(float(np.min(spread)), floor)]
    drawn = calm[:, random.integers(0, calm.shape[1], -(-len(t) // size))].T.ravel()[: len(t)]
    size_drawn = float(np.std(drawn))
    if size_drawn < _HIDDEN * floor:
        return random.normal(0.0, floor, len(t))
    result: Array = drawn * max(1.0, floor / max(size_drawn, 1e-300))
    return result


def _quiet(still: Flags, size: int) -> list[int]:
    """Where windows of that many samples begin that lie end to end in each standstill."""
    ends = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    stretches = zip(ends[::2], ends[1::2], strict=True)
    return [k for first, last in stretches for k in range(first, last - size + 1, size)]


def _at_standstill(t: Array, values: Array, still: Flags) -> float:
    size = max(24, round(_WINDOW / float(np.median(np.diff(t)))))
    starts = _quiet(still, size)
    if len(starts) < _FEWEST:
        return 0.0
    basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, size), 2)
    pieces = np.stack([values[k : k + size] for k in starts], axis=1)
    left = pieces - basis @ np.linalg.lstsq(basis, pieces, rcond=None)[0]
    spreads = np.sqrt(np.sum(left**2, axis=0) / (size - basis.shape[1]))
    return float(np.median(spreads))


def _above_the_signal(t: Array, values: Array) -> float:
    from scipy.signal import welch

    rate = 1.0 / float(np.median(np.diff(t)))
    frequency, density = welch(values, rate, "hann", min(1024, len(values) // 4))
    low, high = (share * rate / 2.0 for share in _BAND)
    inside = (frequency >= low) & (frequency <= high)
    return float(np.sqrt(np.median(density[inside]) * rate / 2.0))


def rounding_step(values: Array) -> float:
    """The step that every value is a multiple of, as far as neighbours tell; 0 where there is none.

    A channel is taken as rounded when its samples meet on few levels: at least a quarter of them
    repeat a level seen before.
    """
    levels = np.unique(values)
    if len(levels) < 3 or len(levels) > 0.75 * len(values):
        return 0.0
    gaps = np.diff(levels)
    return float(np.quantile(gaps[gaps > 1e-12 * np.ptp(values)], 0.05))
