"""Set-point filters of step 2: where a resonance asks for one, and which.

From the model: the speed gain stops short of its ceiling because a vibration above the speed loop's
own rate loses its damping. Notches at that vibration and low-passes about it are tried in the
model; the one that lets the gain rise furthest by the same rule is taken, if it is worth it.

From a measured response of a closed speed loop, G: the open loop is L = G/(1 - G). A peak of |G|
asks for a notch of its frequency; what the loop becomes is L F/(1 + L F), F the filter:

    F = [(s/w_Z)^2 + 2 D_Z s/w_Z + 1] / [(s/w_N)^2 + 2 D_N s/w_N + 1]        (Eq. C6)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.linear import FrequencyResponse
from dualdrive.machine import Machine

__all__ = ["Filter", "Peak", "asked_for", "from_response", "peak_of", "propose"]

Array = NDArray[np.float64]

_WORTH: Final = 1.25  # times the gain without it, or it is not proposed
_NOTCH_DAMPING: Final = (0.3, 0.7)  # of the denominator: narrow, wide
_DEPTH: Final = (0.1, 0.3)  # numerator's damping over the denominator's: 20 dB and 10 dB deep
_LOW_PASS: Final = (0.7, 1.0, 1.5)  # times the vibration's frequency
_PEAK_DB: Final = 3.0  # over the response at low frequencies: what asks for a filter
_WIDTH: Final = 0.5  # damping of a notch's denominator: holds where the peak moves by a tenth
_DEEPEST: Final = 0.05  # of a notch: what a drive still resolves
_COHERENT: Final = 0.8  # below, a point of a measured response says nothing


@dataclass(frozen=True)
class Filter:
    """A second-order filter of a drive's torque set-point; frequencies in Hz, zero 0: low-pass."""

    pole: float
    pole_damping: float
    zero: float = 0.0
    zero_damping: float = 0.0

    def response(self, f: Array) -> NDArray[np.complex128]:
        """F at f, Hz; shape as f."""
        s = 1j * np.asarray(f, float)
        top = 1.0 + 0.0 * s
        if self.zero:
            top = (s / self.zero) ** 2 + 2.0 * self.zero_damping * s / self.zero + 1.0
        below = (s / self.pole) ** 2 + 2.0 * self.pole_damping * s / self.pole + 1.0
        return np.asarray(top / below, np.complex128)

    def on(self, machine: Machine) -> None:
        """Put it into both drives of a machine."""
        machine.core.set("motors.filter_pole", self.pole)
        machine.core.set("motors.filter_pole_damping", self.pole_damping)
        machine.core.set("motors.filter_zero", self.zero)
        machine.core.set("motors.filter_zero_damping", self.zero_damping)

    @property
    def text(self) -> str:
        """In words."""
        if not self.zero:
            return f"low-pass {self.pole:.4g} Hz, D {self.pole_damping:.2g}"
        depth = 20.0 * math.log10(self.zero_damping / self.pole_damping)
        return (
            f"notch {self.zero:.4g} Hz, D_Z {self.zero_damping:.2g}, D_N {self.pole_damping:.2g} "
            f"({depth:.0f} dB)"
        )


def propose(
    machine: Machine, hertz: float, gain: float, best: Callable[[Machine], float]
) -> tuple[Filter, float] | None:
    """The filter that lets the gain rise furthest, and that gain; None where none is worth it.

    hertz:  of the vibration that stops the gain;  gain: without a filter
    best:   the highest gain of a machine by the rule of step 2
    """
    found = []
    for one in _candidates(hertz):
        trial = machine.copy()
        one.on(trial)
        found.append((best(trial), one))
    highest, one = max(found, key=lambda pair: pair[0])
    return (one, highest) if highest >= _WORTH * gain else None


def _candidates(hertz: float) -> Iterator[Filter]:
    for wide in _NOTCH_DAMPING:
        for depth in _DEPTH:
            yield Filter(hertz, wide, hertz, depth * wide)
    for share in _LOW_PASS:
        yield Filter(share * hertz, 0.7)


# --- from a measured response ---------------------------------------------------------------------


@dataclass(frozen=True)
class Peak:
    """A resonance in a closed speed loop: Hz, and dB over the response at low frequencies."""

    frequency_hz: float
    db: float


def peak_of(response: FrequencyResponse) -> Peak | None:
    """The highest peak; None where the response stays within 3 dB of its low end.

    Points of a coherence below 0.8 are left out; a peak stands 3 dB over both of its sides.
    """
    f, size = _trusted(response)
    level = float(np.median(size[: max(3, size.size // 10)]))
    k = int(size.argmax())
    over = float(size[k]) - level
    sides = size[:k], size[k + 1 :]
    stands = all(part.size and part.min() <= size[k] - _PEAK_DB for part in sides)
    return Peak(float(f[k]), over) if over > _PEAK_DB and stands else None


def from_response(response: FrequencyResponse) -> tuple[Peak, Filter, Peak | None] | None:
    """The peak of a measured closed speed loop, a notch for it, and the peak that it leaves.

    None where no peak asks for a filter, or a notch would not lower it by 3 dB.
    """
    peak = peak_of(response)
    if peak is None:
        return None
    depth = max(10.0 ** (-peak.db / 20.0), _DEEPEST)
    notch = Filter(peak.frequency_hz, _WIDTH, peak.frequency_hz, depth * _WIDTH)
    left = peak_of(asked_for(response, notch))
    return (peak, notch, left) if left is None or left.db < peak.db - _PEAK_DB else None


def asked_for(response: FrequencyResponse, one: Filter) -> FrequencyResponse:
    """The closed speed loop with a filter in it, from its response without."""
    closed = response.response
    loop = closed / (1.0 - closed) * one.response(response.frequency_hz)
    return replace(response, response=loop / (1.0 + loop), note=f"with {one.text}")


def _trusted(response: FrequencyResponse) -> tuple[Array, Array]:
    f, size = response.frequency_hz, response.magnitude_db
    if response.coherence is None:
        return f, size
    good = response.coherence >= _COHERENT
    return (f[good], size[good]) if good.sum() > 3 else (f, size)
