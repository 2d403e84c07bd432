"""Where to begin the search for a periodic orbit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dualdrive.assembly import gaps
from dualdrive.cycles.describing import Predicted, describing_function, phasors
from dualdrive.cycles.errors import NoCycleError
from dualdrive.cycles.flow import Flow
from dualdrive.cycles.orbit import half_range

__all__ = ["from_prediction", "from_simulation"]

Array = NDArray[np.float64]

_KICK = 1e-3  # rad/s of the table
_AT_REST = 1e-4  # of the play at the table: less is no motion
_PERIODS = 12  # looked at
_ALIKE = 0.02  # by how much their lengths may differ


def from_simulation(flow: Flow, kick: float, settle: float) -> tuple[Array, float]:
    """A state on the motion that a kick of the table (rad/s) leaves after `settle` s; its period.

    Raises NoCycleError where the machine comes to rest or does not repeat itself.
    """
    name = flow.machine.name
    start = np.zeros(len(flow.states))
    start[flow.states.index("omega_m")] = kick
    late = flow.after(start, settle)
    span = settle / 2
    run = flow.run(late, span, points=20000)
    t, e = np.array(run.t), np.array(run.values[:, run.names.index("theta_m")])
    play = max(
        (flow.core.get(f"{c}.gap") / flow.core.get(f"{c}.ratio") for c in gaps(flow.core)),
        default=0.0,
    )
    if half_range(e) <= _AT_REST * play or half_range(e) == 0:
        raise NoCycleError(
            f"{name}: comes to rest after a kick of {kick:g} rad/s: no cycle was started; "
            "try a larger --kick (kick=), or --guess 'describing function' (guess=)"
        )
    times = _rising(t, e - e.mean())
    lengths = np.diff(times)[-_PERIODS:]
    if lengths.size < 2:
        raise NoCycleError(
            f"{name}: less than two swings in {span:g} s; give a longer --settle (settle=), or a "
            "--guess (guess=)"
        )
    for count in (1, 2, 3, 4):  # an orbit may close after several swings only
        sums = np.convolve(lengths, np.ones(count), "valid")
        if sums.size and np.ptp(sums) <= _ALIKE * sums.mean() / count:
            return flow.after(late, float(times[-1 - count])), float(sums.mean())
    raise NoCycleError(
        f"{name}: does not repeat itself after {settle:g} s (swings last {lengths.min():.3g} s to "
        f"{lengths.max():.3g} s); give a longer --settle (settle=)"
    )


def _rising(t: Array, x: Array) -> Array:
    """Times at which x passes upwards through zero, by straight lines between samples."""
    k = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    return np.asarray(t[k] - x[k] * (t[k + 1] - t[k]) / (x[k + 1] - x[k]))


def from_prediction(flow: Flow, predicted: Predicted | None = None) -> tuple[Array, float]:
    """The state and period of the describing function's cycle, the first unless one is given.

    Raises NoCycleError where there is none.
    """
    if predicted is None:
        found = describing_function(flow.machine)
        if not found:
            raise NoCycleError(f"{flow.machine.name}: the describing function foretells no cycle")
        predicted = found[0]
    states = phasors(flow.machine, predicted)
    return np.array([states[name].real for name in flow.states]), 1.0 / predicted.frequency_hz
