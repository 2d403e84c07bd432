"""Records made ready for the predictor: which channels, where each begins, how fine they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.replay import Record, ReplayError
from dualdrive.replay.channels import INPUTS

Array = NDArray[np.float64]

#: kinds of channel by the first letters of the name, and what their noise is tied to
_KINDS = {"theta": "angle", "omega": "speed", "I": "current", "T": "torque", "U": "voltage"}


@dataclass(frozen=True, eq=False)
class Predictable:
    """One record as the predictor takes it; arrays of shape (n,) or (n, channels), SI.

    kinds: of every channel, what its noise is tied to: encoders of the motors are alike
    steps: finest distance of two readings of every channel, 0 where none is seen
    """

    record: Record
    sampled: Any
    channels: tuple[str, ...]
    kinds: tuple[str, ...]
    steps: tuple[float, ...]
    measured: Array

    @property
    def name(self) -> str:
        """Of the record."""
        return self.record.name

    def initial(self, core: Any, offsets: Mapping[str, float]) -> dict[str, float]:
        """State at the first sample as the encoders have it, less what they add."""
        known = {state for state, _ in core.states()}
        first = {
            c: float(y) - offsets.get(c, 0.0)
            for c, y in zip(self.channels, self.measured[0], strict=True)
        }
        found = {s: x for s, x in self.record.initial.items() if s in known}
        table = first.get("theta_m", found.get("theta_m", 0.0))
        if "theta_m" in known:
            found["theta_m"] = table
        for motor in core.motors:
            n = motor.rpartition("_")[2]
            mesh, gearbox = f"mesh_{n}", f"gearbox_{n}"
            if f"{mesh}.twist" not in known:
                continue
            angle = first.get(f"theta_c{n}")
            if angle is None and f"theta_{n}" in first:
                geared = gearbox in core.connections
                angle = first[f"theta_{n}"] / (core.get(f"{gearbox}.ratio") if geared else 1.0)
            if angle is not None:
                found[f"{mesh}.twist"] = angle - core.get(f"{mesh}.ratio") * table
        return found


def predictable(core: Any, records: Sequence[Record]) -> list[Predictable]:
    """Make records ready.

    Raises:
        ReplayError: a record none of whose channels the machine has.

    """
    return [_predictable(core, record) for record in records]


def _predictable(core: Any, record: Record) -> Predictable:
    signals = {name for name, _, _ in core.signals()}
    trace = record.trace
    channels = [c for c in trace if c in signals and _kind(c) and np.ptp(trace[c]) > 0.0]
    # current and torque of a motor tell the same: where both are recorded, the current counts
    channels = [c for c in channels if not (c[0] == "T" and "I" + c[1:] in channels)]
    if not channels:
        raise ReplayError(f"{record.name}: no channel that the machine simulates varies")
    measured = np.ascontiguousarray(np.column_stack([trace[c] for c in channels]))
    places = [(c, _places(core, c)) for c in channels]
    return Predictable(
        record,
        _core.SampledRecord(dict(record.inputs), np.ascontiguousarray(record.t), places, measured),
        tuple(channels),
        tuple(map(_noise_kind, channels)),
        tuple(_step(trace[c]) for c in channels),
        measured,
    )


def _kind(channel: str) -> str:
    return "" if channel in INPUTS else _KINDS.get(channel.partition("_")[0], "")


def _noise_kind(channel: str) -> str:
    return "table angle" if channel == "theta_m" else f"drive {_kind(channel)}"


def _places(core: Any, channel: str) -> list[str]:
    """Where effects change a reading: the sensor in the loop, then the recorder's channel."""
    if channel == "theta_m":
        return ["table", channel]
    motor = f"motor_{channel.removeprefix('theta_')}"
    return [motor, channel] if channel.startswith("theta_") and motor in core.motors else [channel]


def _step(values: Array) -> float:
    """Step to which a channel is rounded, of which all readings are multiples; 0: none is seen."""
    distances = np.diff(np.unique(values))
    finest = float(np.min(distances[distances > 1e-12 * np.ptp(values)]))
    whole = (values - values[0]) / finest
    return finest if np.mean(np.abs(whole - np.round(whole)) < 0.05) > 0.95 else 0.0
