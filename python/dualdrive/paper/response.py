"""Figures read off a response: step, sine, continuing oscillation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Oscillation", "Sine", "Step", "oscillation", "sine_response", "step_response"]

Array = NDArray[np.float64]

#: the band around the final value within which a step has settled
BAND = 0.02


@dataclass(frozen=True)
class Step:
    """Figures of a step response; None where the response has no such figure.

    delay:       to half the step, s
    rise:        to the whole step for the first time, s
    settling:    from when on it stays within 2 % of the step, s, for a tenth of the record at least
    overshoot:   of the step, 0.17 for 17 %
    crossings:   of the final value until it has settled
    """

    delay: float | None
    rise: float | None
    settling: float | None
    overshoot: float
    crossings: int | None


def step_response(t: Array, y: Array, height: float) -> Step:
    """The figures of y, shape (n,), after a step of `height` at t = 0."""
    share = y / height
    out = np.flatnonzero(np.abs(share - 1.0) > BAND)
    settles = out.size == 0 or t[out[-1]] < t[-1] - 0.1 * (t[-1] - t[0])
    settling = float(t[out[-1] + 1] if out.size else t[0]) if settles else None
    turns = t[1:][np.diff(np.sign(share - 1.0)) != 0]
    return Step(
        delay=_first(t, share, 0.5),
        rise=_first(t, share, 1.0),
        settling=settling,
        overshoot=max(float(share.max()) - 1.0, 0.0),
        crossings=None if settling is None else int((turns < settling).sum()),
    )


def _first(t: Array, share: Array, level: float) -> float | None:
    """When a level is first reached, between samples by a straight line."""
    k = int(np.argmax(share >= level))
    if share[k] < level:
        return None
    if k == 0:
        return float(t[0])
    part = (level - share[k - 1]) / (share[k] - share[k - 1])
    return float(t[k - 1] + part * (t[k] - t[k - 1]))


@dataclass(frozen=True)
class Oscillation:
    """A continuing oscillation: Hz, and half its peak to peak; 0 Hz where it has died away."""

    frequency: float
    amplitude: float


def oscillation(t: Array, x: Array, last: float, floor: float) -> Oscillation:
    """The oscillation of x in the `last` seconds; below `floor` (peak) there is none.

    The frequency counts rising passages through the mean.
    """
    k = t >= t[-1] - last
    times, swing = t[k], x[k] - np.mean(x[k])
    amplitude = float(np.ptp(swing)) / 2.0
    rising = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    if amplitude < floor or rising.size < 2:
        return Oscillation(0.0, amplitude)
    slopes = np.diff(swing)[rising] / np.diff(times)[rising]
    at = times[rising] - swing[rising] / slopes
    return Oscillation(float((at.size - 1) / (at[-1] - at[0])), amplitude)


@dataclass(frozen=True)
class Sine:
    """The answer to a sine: gain and lag (rad) of its own frequency, and the largest value."""

    gain: float
    lag: float
    peak: float


def sine_response(t: Array, y: Array, amplitude: float, frequency: float, periods: int) -> Sine:
    """Fourier coefficient of y over the last whole `periods` of amplitude sin(2 pi f t)."""
    k = t > t[-1] - periods / frequency
    turn = np.exp(-2j * np.pi * frequency * t[k])
    answer = 2j * complex(np.mean(y[k] * turn)) / amplitude
    peak = float(np.abs(y[k]).max()) / amplitude
    return Sine(abs(answer), -float(np.angle(answer)), peak)
