"""Where in a trace a flank is closed: readings of one drive, cut into settled episodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.filtering import Processing, pieces
from dualdrive.traces.names import DRIVES

Array = NDArray[np.float64]

_SHORTEST = 101  # samples between two resets of a counter that are looked at


@dataclass(frozen=True)
class Reading:
    """One drive against the ring on an even grid: deflection in pinion rad, shapes (n,).

    ``speed`` is that of the pinion when closed, i_m ω_m; ``quantum`` the coarsest step of the
    angles.
    """

    record: str
    t: Array
    deflection: Array
    speed: Array
    torque: Array
    step: float
    quantum: float


@dataclass(frozen=True)
class Episode:
    """A stretch of settled contact on one flank (+1 front, -1 back)."""

    record: str
    flank: int
    start: float
    end: float
    deflection: Array
    speed: Array
    torque: Array


def readings(
    traces: Mapping[str, Any] | Sequence[Any] | Any,
    drive: int,
    mesh_ratio: float,
    gear_ratio: float,
) -> list[Reading]:
    """Deflection, speed and torque of one drive, for every piece of every record.

    A jump of an angle (a counter that was reset) starts a record of its own, with its own zero.

    Raises:
        ValueError: a channel is missing, or the trace cannot be laid on an even grid.

    """
    from dualdrive.identify.balance import named

    found = []
    for name, trace in named(traces).items():
        angle, scale = _drive_angle(trace.channels, drive, gear_ratio, name)
        for needed in ("theta_m", f"T_{drive}"):
            if needed not in trace.channels:
                raise ValueError(f"{name}: no channel {needed}; map it to read the play of a mesh")
        parts = _between_resets(trace, ("theta_m", angle))
        if not parts:
            rule = f"no {_SHORTEST} samples in a row between resets of a counter"
            raise ValueError(f"{name}: {rule}, which the play of a mesh takes; record longer")
        for k, part in enumerate(parts):
            own = name if k == 0 else f"{name}, after reset {k}"
            found += _readings(part, own, angle, scale, drive, mesh_ratio)
    return found


def contacts(read: Sequence[Reading], limit: float, settle: float) -> list[Episode]:
    """Stretches with torque beyond ``limit`` in one direction, less the first ``settle`` s."""
    episodes = []
    for reading in read:
        sign = np.where(np.abs(reading.torque) >= limit, np.sign(reading.torque), 0.0)
        edges = np.flatnonzero(np.diff(sign)) + 1
        wait = round(settle / reading.step)
        for index in np.split(np.arange(len(sign)), edges):
            if sign[index[0]] == 0 or len(index) < 2 * wait + 2:
                continue
            kept = slice(index[0] + wait, index[-1])  # the last sample may already let go
            episodes.append(
                Episode(
                    reading.record,
                    int(sign[index[0]]),
                    float(reading.t[kept.start]),
                    float(reading.t[kept.stop]),
                    reading.deflection[kept],
                    reading.speed[kept],
                    reading.torque[kept],
                )
            )
    return episodes


@dataclass(frozen=True)
class _Part:
    t: Array
    channels: dict[str, Array]


def _between_resets(trace: Any, angles: Sequence[str]) -> list[_Part]:
    """Cut where an angle jumps by far more than it ever moves in one sample, and comes not back."""
    t = np.asarray(trace.t, dtype=float)
    values = {n: np.asarray(getattr(c, "values", c), float) for n, c in trace.channels.items()}
    cut = np.zeros(len(t) - 1, dtype=bool)
    for angle in angles:
        change = np.abs(np.diff(values[angle]))
        cut |= change > 20 * max(float(np.quantile(change, 0.999)), _quantum(values[angle]))
    edges = np.flatnonzero(cut) + 1
    return [
        _Part(t[i], {n: x[i] for n, x in values.items()})
        for i in np.split(np.arange(len(t)), edges)
        if len(i) >= _SHORTEST
    ]


def _readings(
    part: _Part, record: str, angle: str, scale: float, drive: int, mesh_ratio: float
) -> list[Reading]:
    """One reading per continuous piece; the ring's speed from its smoothed angle."""
    found = []
    for piece in pieces(part, record, Processing(order=2, decimate=1, trim=0.0)):
        raw = {n: np.interp(piece.t, part.t, part.channels[n]) for n in ("theta_m", angle)}
        quantum = max(
            _quantum(part.channels[angle]) / scale,
            _quantum(part.channels["theta_m"]) * mesh_ratio,
        )
        found.append(
            Reading(
                record,
                piece.t,
                raw[angle] / scale - mesh_ratio * raw["theta_m"],
                mesh_ratio * piece.samples["omega_m"],
                piece.samples[f"T_{drive}"],
                piece.step,
                quantum,
            )
        )
    return found


def _quantum(angle: Array) -> float:
    """The smallest step an angle takes."""
    change = np.abs(np.diff(angle))
    moved = change[change > 0]
    return float(moved.min()) if len(moved) else 0.0


def _drive_angle(
    channels: Mapping[str, Any], drive: int, gear_ratio: float, record: str
) -> tuple[str, float]:
    """The channel of the drive's angle, and what divides it down to the pinion."""
    if drive not in DRIVES:
        raise ValueError(f"play: there is no drive {drive}; choose one of 1 to {DRIVES[-1]}")
    if f"theta_c{drive}" in channels:
        return f"theta_c{drive}", 1.0
    if f"theta_{drive}" in channels:
        return f"theta_{drive}", gear_ratio
    raise ValueError(
        f"{record}: neither theta_c{drive} nor theta_{drive} to read the play from; map one"
    )
