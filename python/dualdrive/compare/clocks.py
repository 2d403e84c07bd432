"""A recording's clock: how much its time stamps jitter, and what that does to a moving signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.recorder import delays
from dualdrive.traces import CHANNELS, Trace

Array = NDArray[np.float64]

_EVEN = 1e-3  # of a step: rounding of the stamps themselves
_BETTER = 0.7  # of the roughness under the other clock
_GAUSS = 1.4826  # standard deviation over median absolute deviation


@dataclass(frozen=True)
class Clock:
    """How a record is sampled.

    step:   median sampling interval, s
    jitter: RMS deviation of a time stamp from an even grid, s
    kind:   ``even``; ``stamps``: the samples are even and their stamps jitter; ``samples``: they
            were taken at the uneven times they are stamped with; ``unclear``
    """

    record: str
    step: float
    jitter: float
    kind: Literal["even", "stamps", "samples", "unclear"]

    @property
    def wrong(self) -> float:
        """By how much a time stamp errs, RMS, s: nothing where samples are where they say."""
        return self.jitter if self.kind in ("stamps", "unclear") else 0.0

    def noise(self, t: Array, values: Array) -> float:
        """RMS noise that the clock puts on a signal: its rate of change times the jitter."""
        if self.wrong == 0.0 or len(t) < 3:
            return 0.0
        even = self.step * np.arange(len(t))
        rate = np.gradient(values, even if self.kind == "stamps" else t)
        return float(self.wrong * np.sqrt(np.mean(rate**2)))

    @property
    def message(self) -> str:
        """What the clock does, and what to do about it."""
        size = f"{1e3 * self.jitter:.2g} ms ({self.jitter / self.step:.0%} of a step)"
        advice = {
            "even": "even",
            "stamps": f"time stamps jitter by {size} while the samples are even; read them with "
            f'[time] sample_time = "{1e3 * self.step:.4g} ms"',
            "samples": f"samples are uneven by {size}, as their stamps say; they are used as such",
            "unclear": f"time stamps jitter by {size}; whether the samples do as well can't be told"
            ", so speed times jitter counts as noise",
        }
        return f"{self.record}: {advice[self.kind]}"


def clock_of(trace: Trace, record: str = "") -> Clock:
    """Estimate the jitter of a trace's time stamps, and whether it is that of the samples.

    Under the right clock a smooth motion is foretold best by its neighbours.
    """
    name = record or trace.name
    t = np.asarray(trace.t)
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    calm = np.flatnonzero(np.abs(np.diff(t) - step) < 0.7 * step)
    step = float(np.mean(np.diff(t)[calm])) if len(calm) else step
    # a stamp's own error stands three times in a second difference: with 1, -2 and 1
    bend = np.diff(t, n=2)
    steady = np.intersect1d(calm, calm - 1)
    steady = steady[steady < len(bend)]
    if len(steady) < 8:
        return Clock(name, step, 0.0, "even")
    own = bend[steady] - np.median(bend[steady])
    jitter = float(np.sqrt(np.mean(np.clip(own, -_top(own), _top(own)) ** 2) / 6.0))
    if jitter < _EVEN * step:
        return Clock(name, step, 0.0, "even")
    return Clock(name, step, jitter, _kind(trace, t, step))


def in_time(core: Any, trace: Trace) -> Trace:
    """The trace with channels shifted back that the machine says its recorder reads late.

    A late recorder (``sensor_delay@theta_m``) is known in a simulated loop, which reads its own
    channels as late; a torque balance needs all channels at one time.
    """
    for channel, late in delays(core).items():
        if channel in trace and late > 0.0:
            early = np.interp(trace.t + late, trace.t, trace[channel])
            trace = trace.with_channel(channel, early)
    return trace


def _kind(trace: Trace, t: Array, step: float) -> Literal["stamps", "samples", "unclear"]:
    ratios = []
    for channel in trace:
        if channel in CHANNELS and channel.startswith("theta_") and np.ptp(trace[channel]) > 0.0:
            values = trace[channel]
            stamped = _roughness(t, values)
            even = _roughness(np.arange(len(t), dtype=np.float64) * np.float64(step), values)
            if stamped > 0.0 and even > 0.0:
                ratios.append(even / stamped)
    if ratios and min(ratios) < _BETTER and max(ratios) < 1.0:
        return "stamps"
    if ratios and max(ratios) > 1.0 / _BETTER and min(ratios) > 1.0:
        return "samples"
    return "unclear"


def _roughness(t: Array, values: Array) -> float:
    """How far samples are from the parabola through their neighbours, where the signal is fast."""
    n = len(t)
    before, after, last = np.arange(1, n - 2), np.arange(2, n - 1), np.arange(3, n)
    first = before - 1
    foretold = np.zeros(len(before))
    nodes = (first, after, last)
    for k in nodes:
        weight = np.ones(len(before))
        for j in nodes:
            if j is not k:
                weight *= (t[before] - t[j]) / (t[k] - t[j])
        foretold += weight * values[k]
    rate = np.abs(values[after] - values[first])
    fast = (rate > 0.3 * np.max(rate)) & (t[last] - t[first] < 6.0 * np.median(np.diff(t)))
    return float(np.median(np.abs(values[before] - foretold)[fast])) if fast.any() else 0.0


def _top(values: Array) -> float:
    """A limit beyond which a value is an outlier."""
    return 5.0 * _GAUSS * float(np.median(np.abs(values))) + 1e-300 if len(values) else 0.0
