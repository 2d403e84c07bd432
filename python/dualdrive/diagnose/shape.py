"""What shape the missing torque has: along which coordinate it is a curve, with bands.

The torque balance of the refitted machine leaves a torque at every sample. Its mean in bins of a
coordinate is a curve; the share of its mean square that the curve takes tells whether the
coordinate is the one. Neighbouring samples are alike, so that a band counts effective samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.result import Shape
from dualdrive.identify import Processing
from dualdrive.identify.coloured import correlation_time
from dualdrive.traces import Trace

Array = NDArray[np.float64]

BINS = 24
_FEWEST = 6  # samples of a bin
_Z = 1.96
#: what a drive engineer calls an equation
NAMES = {
    "total": "table",
    "m": "table",
    "c1": "drive 1",
    "c2": "drive 2",
    "1": "motor 1",
    "2": "motor 2",
}


def shapes(
    machine: Any,
    traces: Mapping[str, Trace],
    settings: Mapping[str, Mapping[str, float]],
    processing: Processing | None = None,
    count: int = 6,
) -> list[Shape]:
    """Curves of the missing torque, those that explain most first.

    Args:
        machine: the core's machine, its nominal numbers refitted.
        traces: with torques or currents and angles; without them there is no curve.
        settings: of each trace.
        processing: filters of the torque balance.
        count: how many curves at most.

    """
    try:
        balance = TorqueBalance(machine, traces, settings, processing)
    except (ValueError, KeyError, StopIteration):
        return []
    left = balance.left(machine, balance.levelled(machine, balance.start))
    if left is None:
        return []
    found: list[Shape] = []
    for e, name in enumerate(balance.equations):
        rows = range(e, len(left), len(balance.equations))
        series = [balance.series[k] for k in rows]
        torque = np.concatenate([left[k][s.keep] for k, s in zip(rows, series, strict=True)])
        if len(torque) < 4 * BINS:
            continue
        torque = torque - np.mean(torque)
        for coordinate, unit, values in _coordinates(balance, list(rows)):
            shape = _curve(NAMES.get(name, name), coordinate, unit, values, torque)
            if shape is not None:
                found.append(shape)
    return sorted(found, key=lambda s: -s.explained)[:count]


def _coordinates(balance: TorqueBalance, rows: Sequence[int]) -> list[tuple[str, str, Array]]:
    """(name, unit, values at the counted samples) of what the torque may depend on."""
    count = len(balance.equations)
    held = [balance.held[k // count] for k in rows]
    keep = [balance.series[k].keep for k in rows]

    def joined(name: str) -> Array | None:
        if not all(name in h.samples for h in held):
            return None
        return np.concatenate([h.samples[name][own] for h, own in zip(held, keep, strict=True)])

    speed = next(
        (s for n in ("omega_m", "omega_1", "omega_c1") if (s := joined(n)) is not None), None
    )
    angle = next(
        (s for n in ("theta_m", "theta_1", "theta_c1") if (s := joined(n)) is not None), None
    )
    found = []
    if speed is not None:
        found += [("speed", "rad/s", speed), ("direction", "", np.sign(speed))]
    if angle is not None:
        found.append(("angle", "rad", angle))
    measured = np.concatenate(
        [balance.series[k].measured[own] for k, own in zip(rows, keep, strict=True)]
    )
    found.append(("drive torque", "N*m", measured))
    time = np.concatenate([h.t[own] for h, own in zip(held, keep, strict=True)])
    found.append(("time", "s", time))
    return found


def _curve(equation: str, coordinate: str, unit: str, values: Array, torque: Array) -> Shape | None:
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
    if coordinate == "direction":
        edges = np.array([-1.5, 0.0, 1.5])
    if len(edges) < 3:
        return None
    where = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    alike = 1.0 + 2.0 * correlation_time(torque)
    at, mean, width, square = [], [], [], 0.0
    for b in range(len(edges) - 1):
        own = torque[where == b]
        if len(own) < _FEWEST:
            continue
        at.append(float(np.mean(values[where == b])))
        mean.append(float(np.mean(own)))
        width.append(_Z * float(np.std(own)) / np.sqrt(max(len(own) / alike, 2.0)))
        square += len(own) * mean[-1] ** 2
    whole = float(torque @ torque)
    if len(at) < 2 or whole <= 0.0:
        return None
    a, m, w = np.array(at), np.array(mean), np.array(width)
    # a curve through as many bins explains some of any noise
    chance = (len(at) - 1) * alike / len(torque)
    explained = min(max((square / whole - chance) / max(1.0 - chance, 1e-9), 0.0), 1.0)
    return Shape(equation, coordinate, unit, "N*m", a, m, m - w, m + w, explained)
