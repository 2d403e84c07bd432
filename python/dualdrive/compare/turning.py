"""Which angles turn under a residual, and which of their orders stand out of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.comparison import Quantity
from dualdrive.compare.orders import Order, Turning, examined, lines, significant
from dualdrive.compare.where import Condition
from dualdrive.identify import Processing
from dualdrive.identify.filtering import pieces
from dualdrive.identify.model import CoreModel
from dualdrive.replay import ratio_to_table
from dualdrive.traces import Trace

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_KINDS = ("following error", "current", "torque", "deflection")


@dataclass(frozen=True, eq=False)
class Residual:
    """Something whose spectrum is looked at: arrays of shape (n,)."""

    record: str
    channel: str
    unit: str
    t: Array
    values: Array
    counts: Flags


def orders_of(core: Any, traces: Mapping[str, Trace], residuals: Sequence[Residual]) -> list[Order]:
    """Lines that stand out of the whole family of orders, angles and residuals, clearest first.

    traces: record -> the trace that holds its angles
    """
    found: list[Order] = []
    family = 0
    geared = False
    for r in residuals:
        angles = _angles(core, traces[r.record], r.t)
        geared |= any(a.ratio != 1.0 for a in angles)
        family += examined(angles, r.counts)
        found += lines(r.record, r.channel, r.unit, r.values, r.counts, angles)
    return significant(found, family, geared=geared)


def _angles(core: Any, trace: Trace, t: Array) -> list[Turning]:
    """Table, pinions and motors: recorded, or by their ratio to one that is."""
    known = {"table": "theta_m"}
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        known |= {motor: f"theta_{n}"}
        if f"pinion_{n}" in core.bodies:
            known |= {f"pinion_{n}": f"theta_c{n}"}
    found, master = [], _master(core, trace, known)
    if master is None:
        return []
    for part, angle in known.items():
        ratio = ratio_to_table(core, part)
        values = trace[angle] if angle in trace else master * ratio
        found.append(Turning(part.replace("_", " "), ratio, np.interp(t, trace.t, values)))
    return found


def _master(core: Any, trace: Trace, known: Mapping[str, str]) -> Array | None:
    """The table's angle, from any that is recorded."""
    for part, angle in known.items():
        if angle in trace:
            return np.asarray(trace[angle] / ratio_to_table(core, part))
    return None


def of_channels(quantities: Sequence[Quantity]) -> list[Residual]:
    """Residuals of the channels that the headline counts."""
    return [
        Residual(q.record, q.name, q.unit, q.t, q.residual, q.counted)
        for q in quantities
        if q.headline and q.kind in _KINDS
    ]


def of_balance(
    core: Any,
    traces: Mapping[str, Trace],
    quantities: Sequence[Quantity],
    processing: Processing | None,
) -> list[Residual]:
    """What the model asks for against the torque as it was recorded: no filter hides its ripple."""
    found = []
    for q in quantities:
        parts = list(pieces(traces[q.record], q.record, processing or Processing()))
        t = np.concatenate([p.t for p in parts])
        raw = [CoreModel(core).balance(p.samples, []).select([q.name]).measured[0] for p in parts]
        inside = (t >= q.t[0]) & (t <= q.t[-1])
        asked = np.interp(t[inside], q.t, q.simulated)
        counts = np.interp(t[inside], q.t, q.counted.astype(np.float64)) > 0.5
        values = asked - np.concatenate(raw)[inside]
        found.append(Residual(q.record, q.name, q.unit, t[inside], values, counts))
    return found


def as_conditions(orders: Sequence[Order]) -> list[Condition]:
    """Each line as a condition under which the error is larger."""
    return [
        Condition("order", f"{o.channel}: {o.label}", o.excess, 1.0, o.share, o.p) for o in orders
    ]
