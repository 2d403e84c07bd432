"""What a record begins with where the machine was on before: estimated from the record itself.

Tension that still builds up decays over seconds; the filter, whose gains soon are the steady ones,
learns what decays faster. The controller's states at the first sample are unknowns of their own
(Rosenberg, Annals of Economic and Social Measurement 2 (1973) 399-428; Harvey, Forecasting,
Structural Time Series Models and the Kalman Filter, 3.4): their effect on the innovations is linear
while contacts stay, and a Gauss-Newton step or two finds them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.levenberg_marquardt import inflation
from dualdrive.innovations.prediction import GIVEN, predicted
from dualdrive.innovations.records import Predictable
from dualdrive.innovations.variant import Point

Array = NDArray[np.float64]

_STEPS = 3  # of Gauss-Newton
_DIFFERENCE = 1e-3  # of a standard deviation, for finite differences


def begun(grey: GreyBox, point: Point, gains: Sequence[Any]) -> GreyBox:
    """The same records, begun where their first states are likeliest.

    Args:
        grey: on whole records.
        point: a machine that follows them.
        gains: Kalman gains there, per record.

    """
    core, offsets = grey.machine(point.variant, point.theta), grey.constants(point.theta)
    over = inflation(point)

    def one(job: tuple[Predictable, Any]) -> Predictable:
        record, own = job
        return _begun(core, offsets, grey.offsets, record, own, over) if record.unsure else record

    steps = (len(r.unsure) + len(grey.offsets) + 2 for r in grey.records if r.unsure)
    grey.counter.replays += sum(1 + _STEPS * step for step in steps)
    return grey.on(list(grey.pool.map(one, zip(grey.records, gains, strict=True))))


def _begun(
    core: Any,
    offsets: Mapping[str, float],
    sigmas: Mapping[str, float],
    record: Predictable,
    gains: Any,
    over: float,
) -> Predictable:
    """One record; what its sensors add may move beside, lest it stands for a tension."""
    states, channels = list(record.unsure), [c for c in sigmas if c in record.channels]
    unit = np.array([*record.unsure.values(), *(sigmas[c] for c in channels)])

    def at(x: Array) -> tuple[Predictable, dict[str, float]]:
        first = dict(zip(states, map(float, x), strict=False))
        added = dict(zip(channels, map(float, x[len(states) :]), strict=True))
        return replace(record, settled={**record.settled, **first}), {**offsets, **added}

    def whitened(x: Array) -> Array | None:
        there, constants = at(x)
        try:
            found = predicted(core, constants, there, gains, given=GIVEN)
        except (ValueError, RuntimeError):
            return None
        return np.asarray(found["residuals"]).ravel() / np.sqrt(over) if found["finite"] else None

    start = np.array([*(record.settled[s] for s in states), *(offsets[c] for c in channels)])
    centre = start * np.r_[np.ones(len(states)), np.zeros(len(channels))]
    x, now = start, whitened(start)
    for _ in range(_STEPS):
        if now is None:
            return record
        moved = [whitened(x + e) for e in np.diag(_DIFFERENCE * unit)]
        J = np.stack([0.0 * now if f is None else (f - now) / _DIFFERENCE for f in moved])
        off = (x - centre) / unit
        cost = float(now @ now + off @ off)
        step = -unit * np.linalg.solve(J @ J.T + np.eye(len(unit)), J @ now + off)
        trials = [(y, whitened(y)) for y in (x + step, x + 0.3 * step)]
        costs = [
            np.inf if f is None else float(f @ f + np.sum(((y - centre) / unit) ** 2))
            for y, f in trials
        ]
        best = int(np.argmin(costs))
        if not costs[best] < cost:
            break
        x, now = trials[best]
    return at(x)[0]
