"""What the sensors alone leave of each series, seen while the machine stands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.confront import Series

Array = NDArray[np.float64]

_FEWEST, _STRETCH = 30, 0.15  # samples, s: a standstill long enough to show its noise
_OF_SPREAD = 1e-3  # no probe need be fainter
#: of the record's own estimate: a model that hunts is no noise, and noise that a filter has
#: coloured reads down to a third in the spectrum above the signal
_LEAST, _MOST = 0.5, 3.0


def ratios(series: Sequence[Series], left: Sequence[Array], best: Sequence[Array]) -> Array:
    """Residual over noise floor, RMS, of every series with samples enough, shape (series,).

    left: what is judged; best: what the best hypothesis leaves, which the floors are read off
    """
    if not any(s.keep.sum() > _FEWEST for s in series):
        return np.ones(1)  # too short to show anything
    floors = [floor_of(s, r) for s, r in zip(series, best, strict=True)]
    return np.array(
        [
            float(np.std(r[s.keep])) / max(f, 1e-9 * s.spread, 1e-300)
            for s, r, f in zip(series, left, floors, strict=True)
            if s.keep.sum() > _FEWEST
        ]
    )


def heard_above(series: Series, left: Array) -> float:
    """What a probe must be heard above, RMS: the floor, or what the machine leaves if that is more.

    left: what it leaves, (n,)
    """
    own = left[series.keep]
    return max(series.floor, _OF_SPREAD * series.spread, float(np.std(own)) if len(own) else 0.0)


def floor_of(series: Series, left: Array) -> float:
    """RMS noise of a series: what is left where the machine stands, or else the record's estimate.

    left: what the best hypothesis leaves; a constant of each standstill is taken out, since dry
        friction may hold any torque there. Where even that hypothesis fails the machine may move
        at standstill, so that the record's own estimate bounds it.
    """
    t, still = series.t, series.still & series.keep
    ends = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    square = count = 0.0
    for first, last in zip(ends[::2], ends[1::2], strict=True):
        if last - first >= _FEWEST and t[last - 1] - t[first] >= _STRETCH:
            own = left[first:last] - np.mean(left[first:last])
            square, count = square + float(own @ own), count + len(own) - 1
    if count < 2 * _FEWEST:
        return series.floor
    seen = float(np.sqrt(square / count))
    return min(max(seen, _LEAST * series.floor), _MOST * series.floor)
