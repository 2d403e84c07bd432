"""Even time steps, without pretending to know more than the samples say."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from .log import Issue, Log, TraceError

if TYPE_CHECKING:
    from .trace import Trace

__all__ = ["METHODS", "resample"]

Floats = NDArray[np.float64]

METHODS: Final = ("auto", "linear", "previous", "pchip", "mean")
_COARSER: Final = 1.5  # from this ratio of steps on, averaging keeps fast content from folding back


def resample(trace: Trace, step: float | None, method: str = "auto") -> Trace:
    """Return the trace on even steps from its first sample on; never beyond its last.

    step:    s; the median step when left out
    method:  linear    straight lines between samples
             pchip     smooth and without overshoot; for clean signals
             previous  the last sample before: what a held output did
             mean      average of the straight lines over one new step, centred: for coarser steps,
                       where picking single samples would fold fast content into slow
             auto      mean for steps at least 1.5 times coarser, else linear; channels that take
                       few values only (switches, settings) always hold the previous one

    Raises TraceError for a trace with pauses (take its `segments`), fewer than two samples, or a
    step that is not positive or exceeds the duration.
    """
    if method not in METHODS:
        message = f"{trace.name}: method {method!r} unknown; use one of {', '.join(METHODS)}"
        raise TraceError(message, kind="name")
    if trace.breaks:
        rows = trace.rows[list(trace.breaks)].tolist()
        message = f"{trace.name}: has {len(rows)} pauses; resample each of its segments()"
        raise TraceError(message, kind="gap", rows=rows)
    step = trace.step if step is None else step
    if len(trace) < 2 or not 0 < step <= trace.duration:
        rule = f"step {step:g} s does not fit {trace.duration:g} s"
        raise TraceError(f"{trace.name}: {rule}; use another one", kind="name")
    count = int(np.floor(trace.duration / step * (1 + 1e-12))) + 1
    t = np.minimum(trace.t[0] + step * np.arange(count), trace.t[-1])
    usual = method
    if method == "auto":
        usual = "mean" if step >= _COARSER * trace.step else "linear"
    channels = {
        name: _onto(t, trace.t, values, _method(values, usual, method), step)
        for name, values in trace.channels.items()
    }
    nearest = np.clip(np.searchsorted(trace.t, t, side="right") - 1, 0, len(trace) - 1)
    exact = np.count_nonzero(np.isclose(trace.t[nearest], t, rtol=0, atol=1e-9 * step))
    message = f"resampled to {1e3 * step:.6g} ms by {usual}; {exact} of {count} on a measured time"
    log = Log((*trace.log, Issue("converted", message)))
    rows = trace.rows[nearest]
    return replace(trace, t=t, channels=channels, rows=rows, log=log)


def _method(values: Floats, usual: str, asked: str) -> str:
    """Switches and settings are held, not averaged, unless the caller insists."""
    if asked != "auto":
        return usual
    few = np.unique(values[:: max(len(values) // 1000, 1)]).size <= 8
    return "previous" if few and np.unique(values).size <= 8 else usual


def _onto(new: Floats, t: Floats, values: Floats, method: str, step: float) -> Floats:
    if method == "linear":
        return np.interp(new, t, values)
    if method == "previous":
        return values[np.clip(np.searchsorted(t, new, side="right") - 1, 0, len(t) - 1)]
    if method == "pchip":
        from scipy.interpolate import PchipInterpolator

        return np.asarray(PchipInterpolator(t, values)(new), dtype=np.float64)
    return _mean(new, t, values, step)


def _mean(new: Floats, t: Floats, values: Floats, step: float) -> Floats:
    """Average of the piecewise linear signal over the new step around each time; exact integral."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])

    def integral(at: Floats) -> Floats:
        k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
        past = at - t[k]
        slope = (values[k + 1] - values[k]) / (t[k + 1] - t[k])
        return np.asarray(area[k] + past * (values[k] + 0.5 * slope * past))

    # at the ends the window shrinks evenly on both sides, so that no ramp is bent
    half = np.minimum(0.5 * step, np.minimum(new - t[0], t[-1] - new))
    inside = half > 1e-9 * step
    mean = np.interp(new, t, values)
    left, right = (new - half)[inside], (new + half)[inside]
    mean[inside] = (integral(right) - integral(left)) / (right - left)
    return mean
