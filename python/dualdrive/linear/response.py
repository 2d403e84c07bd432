"""A frequency response, computed or measured, and what it says about a loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.display import Displayed
from dualdrive.linear.errors import LinearError

__all__ = ["FrequencyResponse", "Margins", "margins_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Margins:
    """How far a loop is from its limit of stability.

    gain_db:     by how much its gain may rise, dB; None: by any amount
    gain_hz:     where its phase passes -180 deg then
    phase_deg:   by how much its phase may fall; None: its gain never passes 1
    phase_hz:    where its gain passes 1 then
    delay_s:     the shortest delay that takes a phase up
    fall_db:     by how much its gain may fall, dB; None: by any amount
    stable:      of the closed loop; None where it isn't known, as from a measured response
    """

    gain_db: float | None
    gain_hz: float | None
    phase_deg: float | None
    phase_hz: float | None
    delay_s: float | None
    fall_db: float | None
    stable: bool | None

    @property
    def text(self) -> str:
        """One line in words."""
        if self.stable is False:
            return "closed loop unstable: it has no margins"
        gain = "any" if self.gain_db is None else f"{self.gain_db:.1f} dB at {self.gain_hz:.3g} Hz"
        phase = (
            "any"
            if self.phase_deg is None
            else f"{self.phase_deg:.1f} deg at {self.phase_hz:.3g} Hz"
        )
        unknown = "" if self.stable else ", if the closed loop is stable"
        return f"gain margin {gain}, phase margin {phase}{unknown}"


@dataclass(frozen=True, eq=False)
class FrequencyResponse(Displayed, picture="bode"):
    """Output over input at frequencies; SI.

    frequency_hz:  increasing, shape (n,)
    response:      complex, shape (n,)
    unit:          of output over input
    note:          what it was computed with: modes, loops cut, approximations
    coherence:     of a measured or simulated response, 0 to 1, shape (n,); else None
    distortion:    of a simulated one: RMS of harmonics over the fundamental, shape (n,); else None
    stable:        of the system that answers; None where it isn't known
    origin:        model, simulated or measured
    """

    frequency_hz: Array
    response: NDArray[np.complex128]
    input: str
    output: str
    unit: str = ""
    note: str = ""
    coherence: Array | None = None
    distortion: Array | None = None
    stable: bool | None = None
    origin: str = "model"

    def __post_init__(self) -> None:
        f = np.asarray(self.frequency_hz, float)
        if f.ndim != 1 or f.size < 1 or f.shape != np.shape(self.response):
            sizes = f"{f.shape} frequencies, {np.shape(self.response)} values"
            raise LinearError(f"frequency response: {sizes}; give one value for each")
        if not (f[0] > 0 and (np.diff(f) > 0).all() and np.isfinite(f[-1])):
            raise LinearError("frequency response: frequencies must be positive and increasing")

    @property
    def magnitude_db(self) -> Array:
        """20 log10 of the magnitude, shape (n,); minus infinity where there is no response."""
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(np.abs(self.response)))

    @property
    def phase_deg(self) -> Array:
        """Continuous along frequency, shape (n,)."""
        return np.asarray(np.degrees(np.unwrap(np.angle(self.response))))

    def at(self, frequencies_hz: ArrayLike) -> NDArray[np.complex128]:
        """Between its frequencies: log magnitude and phase linear in log frequency.

        Raises LinearError outside its range.
        """
        f = np.atleast_1d(np.asarray(frequencies_hz, float))
        low, high = self.frequency_hz[0], self.frequency_hz[-1]
        if f.size and (f.min() < low * (1 - 1e-9) or f.max() > high * (1 + 1e-9)):
            raise LinearError(
                f"{self.output}/{self.input}: known from {low:g} Hz to {high:g} Hz; "
                f"asked at {f.min():g} Hz to {f.max():g} Hz"
            )
        at, known = np.log(f), np.log(self.frequency_hz)
        size = np.interp(at, known, np.log(np.maximum(np.abs(self.response), 1e-300)))
        return np.asarray(np.exp(size + 1j * np.interp(at, known, np.radians(self.phase_deg))))

    def bandwidth_hz(self, level_db: float = -3.0) -> float | None:
        """The lowest frequency at which the magnitude falls through `level_db`; None if nowhere."""
        found = _crossings(self.magnitude_db - level_db, falling=True)
        return float(self._between(found[0])) if found else None

    def peak(self) -> tuple[float, float]:
        """Frequency, Hz, and size, dB, of the largest magnitude."""
        k = int(np.argmax(np.abs(self.response)))
        return float(self.frequency_hz[k]), float(self.magnitude_db[k])

    def margins(self) -> Margins:
        """Read as the open loop L with negative feedback: 1 + L is its return difference."""
        return margins_of(self)

    def _between(self, place: float) -> float:
        """The frequency at a fractional index."""
        at = np.interp(place, np.arange(self.frequency_hz.size), np.log(self.frequency_hz))
        return float(np.exp(at))

    def figures(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        found: dict[str, Any] = {
            "input": self.input,
            "output": self.output,
            "unit": self.unit,
            "origin": self.origin,
            "note": self.note,
            "stable": self.stable,
            "frequency_hz": self.frequency_hz.tolist(),
            "real": self.response.real.tolist(),
            "imaginary": self.response.imag.tolist(),
        }
        for name in ("coherence", "distortion"):
            values = getattr(self, name)
            if values is not None:
                found[name] = values.tolist()
        return found


def _crossings(values: Array, *, falling: bool = False) -> list[float]:
    """Fractional indices at which values pass through zero."""
    found = []
    for k in np.flatnonzero(np.isfinite(values[:-1]) & np.isfinite(values[1:])):
        a, b = values[k], values[k + 1]
        if (a > 0 >= b) or (not falling and a < 0 <= b):
            found.append(float(k + a / (a - b)))
    return found


def margins_of(loop: FrequencyResponse) -> Margins:
    """Gain and phase margins between its frequencies, the smallest of each kind.

    A gain of 1 that is passed several times gives several phase margins; the least counts.
    """
    if loop.stable is False:
        return Margins(None, None, None, None, None, None, stable=False)
    size, phase = loop.magnitude_db, loop.phase_deg
    places = np.arange(size.size)
    rise: list[tuple[float, float]] = []
    fall: list[float] = []
    lowest, highest = (int(np.floor((edge + 180) / 360)) for edge in (phase.min(), phase.max()))
    for turn in range(lowest, highest + 1):
        for place in _crossings(phase - (360 * turn - 180)):
            gain = float(np.interp(place, places, size))
            if gain < 0:
                rise.append((-gain, loop._between(place)))
            else:
                fall.append(gain)
    left: list[tuple[float, float]] = []
    late = []
    for place in _crossings(size):
        short, f = (float(np.interp(place, places, phase)) + 180) % 360, loop._between(place)
        left.append((min(short, 360 - short), f))
        late.append(short / 360 / f)
    gain_db, gain_hz = min(rise, default=(None, None))
    phase_deg, phase_hz = min(left, default=(None, None))
    return Margins(
        gain_db,
        gain_hz,
        phase_deg,
        phase_hz,
        delay_s=min(late, default=None),
        fall_db=min(fall, default=None),
        stable=loop.stable,
    )
