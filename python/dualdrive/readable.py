"""The unit in which values read best, for tables and pictures alike: arc seconds, mm/s, kN·m."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.units import conversion, human

__all__ = ["Scale", "interval", "ladder", "scale"]

Array = NDArray[np.float64]


class Scale(NamedTuple):
    """A unit to read: ``shown = si / factor``, and how the unit is printed."""

    factor: float
    unit: str

    def __call__(self, si: ArrayLike) -> Array:
        """SI values as they are drawn."""
        return np.asarray(si, dtype=np.float64) / self.factor

    def label(self, what: str) -> str:
        """The axis label: what it is and in which unit."""
        return f"{what} [{self.unit}]" if self.unit else what


# SI unit -> (peak up to which it is used, unit), rising; the last one takes the rest.
_READABLE: Final[dict[str, tuple[tuple[float, str], ...]]] = {
    "rad": ((1e-2, "arcsec"), (0.2, "mrad"), (np.inf, "deg")),
    "m": ((2e-4, "um"), (1.0, "mm"), (np.inf, "m")),
    "rad/s": ((0.5, "mrad/s"), (np.inf, "rad/s")),
    "m/s": ((1.0, "mm/s"), (np.inf, "m/s")),
    "N*m": ((1.0, "mN*m"), (2e4, "N*m"), (2e7, "kN*m"), (np.inf, "MN*m")),
    "N": ((2e4, "N"), (np.inf, "kN")),
    "s": ((0.5, "ms"), (np.inf, "s")),
}

_NOUGHT: Final = 1e-4  # of an interval's width: below its last digit
_MOST_DIGITS: Final = 8  # of the ends of an interval, however narrow


def scale(unit: str, values: ArrayLike = (), prefer: str | None = None) -> Scale:
    """The unit in which values read best: arc seconds for small angles, ms for short times.

    values: SI, to judge the size by
    prefer: a unit to take whatever the size
    """
    if prefer is None:
        peak = float(np.max(np.abs(np.asarray(values, dtype=np.float64)), initial=0.0))
        prefer = next((name for top, name in _READABLE.get(unit, ()) if peak < top), unit)
    return Scale(conversion(prefer, unit).scale, _printed(prefer))


def ladder(unit: str) -> list[tuple[float, Scale]]:
    """Every unit in which values of an SI unit are read, after the peak up to which it is."""
    rungs = _READABLE.get(unit, ((np.inf, unit),))
    return [(top, scale(unit, prefer=name)) for top, name in rungs]


def interval(value: float, low: float, high: float, unit: str = "", *, digits: int = 4) -> str:
    """A value and where it lies, all in one unit: ``0.998 mm [0.95 .. 1.05 mm]``.

    The largest of the three chooses the unit. A narrow interval has as many digits more as it
    takes to tell its ends apart, and what is nothing beside its width is 0. What was counted or
    held (low = high), or whose ends are not known, has none.
    """
    if not math.isfinite(value):
        return "–"
    if not low < high:
        return human(value, unit, digits=digits)
    ends = [abs(x) for x in (value, low, high) if math.isfinite(x)]
    largest, width = max(ends, default=0.0), high - low
    if math.isfinite(width):
        value, low, high = (0.0 if abs(x) < _NOUGHT * width else x for x in (value, low, high))
    if 0.0 < width < largest:
        digits = max(digits, min(math.floor(math.log10(largest / width)) + 2, _MOST_DIGITS))
    one, first, last = (human(x, unit, digits=digits, like=largest) for x in (value, low, high))
    return f"{one} [{first.partition(' ')[0]} .. {last}]"


def _printed(unit: str) -> str:
    for written, shown in (("*", "·"), ("^2", "²"), ("um", "µm"), ("ohm", "Ω")):
        unit = unit.replace(written, shown)
    return unit
