"""How far what a machine leaves of each series stands above what the sensors alone leave."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.confront import Series

Array = NDArray[np.float64]

_FEWEST = 30  # samples of a series that shows anything
_OF_SPREAD = 1e-3  # no probe need be fainter


def ratios(series: Sequence[Series], left: Sequence[Array]) -> Array:
    """Residual over noise floor, RMS, of every series with samples enough, shape (series,)."""
    found = [
        float(np.std(r[s.keep])) / max(s.floor, 1e-9 * s.spread, 1e-300)
        for s, r in zip(series, left, strict=True)
        if s.keep.sum() > _FEWEST
    ]
    return np.array(found) if found else np.ones(1)  # too short to show anything


def heard_above(series: Series, left: Array) -> float:
    """What a probe must be heard above, RMS: the floor, or what the machine leaves if that is more.

    left: what it leaves, (n,)
    """
    own = left[series.keep]
    return max(series.floor, _OF_SPREAD * series.spread, float(np.std(own)) if len(own) else 0.0)
