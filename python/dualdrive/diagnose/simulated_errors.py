"""Errors of simulated loops, and what the sensors' noise alone would leave."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations import GreyBox, Variant, predictable, simulated
from dualdrive.replay import Record, headline

if TYPE_CHECKING:
    from dualdrive.diagnose.selection.fitted import Fitted

Array = NDArray[np.float64]


def simulated_error(core: Any, played: Sequence[Record]) -> float:
    """Headline error of a machine simulated over records, its numbers held.

    Constants of the sensors and the first angles are fitted. Not a number where the machine does
    not run there.
    """
    grey = GreyBox(core, predictable(core, played), [])
    return error_of(grey, Variant(core), np.zeros(grey.shared))


def error_of(grey: GreyBox, variant: Variant, theta: Array) -> float:
    """Headline error of a variant simulated over the records; NaN where it does not run."""
    found = simulated(grey, variant, theta)
    if found is None:
        return float("nan")
    left, whole = dict[str, float](), dict[str, float]()
    for r, missed in zip(grey.records, found, strict=True):
        own = dict(zip(r.channels, missed.T, strict=True))
        for c in r.record.channels:
            total = sum(factor * own[name] for name, factor in c.parts if name in own)
            residual = np.broadcast_to(total, len(r.record.t))
            residual = residual - np.mean(residual) if c.floating else residual
            left[c.name] = left.get(c.name, 0.0) + float(residual @ residual)
            whole[c.name] = whole.get(c.name, 0.0) + c.spread**2 * len(r.record.t)
    channels = [c for r in grey.records for c in r.record.channels]
    return headline({n: float(np.sqrt(left[n] / whole[n])) for n in left}, channels)


def noise_floor(grey: GreyBox, f: Fitted) -> float:
    """Headline error that the sensors' noise alone would leave, as the likelihood has it."""
    left, whole = dict[str, float](), dict[str, float]()
    channels = [c for r in grey.records for c in r.record.channels]
    for r in grey.records:
        variance = f.noise.variance(r)
        for c in r.record.channels:
            own = sum(factor**2 * variance.get(name, 0.0) for name, factor in c.parts)
            left[c.name] = left.get(c.name, 0.0) + own * len(r.record.t)
            whole[c.name] = whole.get(c.name, 0.0) + c.spread**2 * len(r.record.t)
    return headline({n: float(np.sqrt(left[n] / whole[n])) for n in left}, channels)
