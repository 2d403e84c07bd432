"""A recording's clock: how much its time stamps jitter, and what that does to a moving signal.

A recorder may take its samples evenly and stamp them late. The motion tells which it was: read at
the right times it is smooth; read at stamps that jitter it is as rough as its speed times the
jitter, and a feed-forward turns that into current.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.recorder import delays
from dualdrive.traces import CHANNELS, Trace

Array = NDArray[np.float64]

Kind = Literal["stamps", "samples", "unclear"]

_ROUNDING = 1e-3  # of a step: rounding of the stamps themselves
_EXACT = 1e-4  # of a step: what the time of a sample is not known to anyway
_PAUSES = 0.3  # of a step: beyond it a clock has pauses, not jitter
_BETTER = 0.7  # of the roughness under the other clock
_SURE = 3.0  # standard errors of a clock
_FEWEST = 32  # stamps that make a clock
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
    kind: Kind | Literal["even"]

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
    if jitter < _ROUNDING * step:
        return Clock(name, step, 0.0, "even")
    return Clock(name, step, jitter, _kind(trace, step * np.arange(len(t), dtype=np.float64)))


def evened(trace: Trace) -> tuple[Trace, float]:
    """The trace on an even clock unless its motion says that it was sampled unevenly.

    Where nothing tells, as where all was slow, a converter's own clock is the likelier; what is no
    more than the rounding of stamps stays as every other verb reads it, unless the motion tells.

    Returns:
        The trace, and the RMS jitter that was taken out, s (0 where it stays as it is).

    """
    t = trace.t
    if len(t) < _FEWEST or len(getattr(trace, "breaks", ())):
        return trace, 0.0
    even = _straight(t)
    jitter, step = t - even, float(even[1] - even[0])
    size = float(np.std(jitter))
    if size <= _EXACT * step or float(np.max(np.abs(jitter))) > _PAUSES * step:
        return trace, 0.0
    kind = _kind(trace, even)
    if kind == "stamps" or (kind == "unclear" and size > _ROUNDING * step):
        return replace(trace, t=even), size
    return trace, 0.0


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


def _straight(t: Array) -> Array:
    """The even clock nearest to stamps, (n,) each, s.

    Its rate is one in round hertz, as rates are set, and it begins at zero, unless the stamps tell
    it apart.
    """
    k = np.arange(len(t), dtype=np.float64)
    step, first = (float(x) for x in np.polyfit(k, t, 1))
    left = float(np.std(t - (first + step * k)))
    # standard errors of a straight line's slope and of its value at the first of n points
    of_step, of_first = left * np.sqrt(12.0 / len(t) ** 3), 2.0 * left / np.sqrt(len(t))
    rate = float(f"{1.0 / step:.4g}")
    step = 1.0 / rate if abs(1.0 / rate - step) < _SURE * of_step else step
    first = float(np.mean(t - step * k))
    return (0.0 if abs(first) < _SURE * of_first else first) + step * k


def _kind(trace: Trace, even: Array) -> Kind:
    """Whether the motion is smooth at the stamps or on the even clock, (n,), s.

    A command has no noise: where it tells, it decides; else the encoders do, of one mind.
    """
    angles = [c for c in trace if c in CHANNELS and c.startswith("theta_") and np.ptp(trace[c]) > 0]
    commands = [c for c in angles if c == "theta_ref"]
    for channels in filter(None, (commands, angles)):
        ratios = [_ratio(trace.t, even, trace[c]) for c in channels]
        if min(ratios) < _BETTER and max(ratios) < 1.0:
            return "stamps"
        if max(ratios) > 1.0 / _BETTER and min(ratios) > 1.0:
            return "samples"
    return "unclear"


def _ratio(t: Array, even: Array, values: Array) -> float:
    """Roughness of values on the even clock over that at their stamps; 1 where neither does."""
    rounding = float(np.finfo(np.float64).eps * np.max(np.abs(values)))
    return max(_roughness(even, values), rounding) / max(_roughness(t, values), rounding)


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
