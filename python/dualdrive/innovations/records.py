"""Records made ready for the predictor: which channels, where each begins, how fine they are."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.recorder import read_at, reads
from dualdrive.replay import Record, ReplayError
from dualdrive.replay.channels import INPUTS
from dualdrive.replay.record import with_settings

Array = NDArray[np.float64]

_LOOKS = 8  # at a machine while it settles, at times that double

#: kinds of channel by the first letters of the name, and what their noise is tied to
_KINDS = {"theta": "angle", "omega": "speed", "I": "current", "T": "torque", "U": "voltage"}


@dataclass(frozen=True, eq=False)
class Predictable:
    """One record, or stretches of one, as the predictor takes it; arrays (n, channels), SI.

    record: the whole one
    kinds: of every channel, what its noise is tied to: encoders of the motors are alike
    steps: finest distance of two readings of every channel, 0 where none is seen
    begins: per stretch, state -> value at its first sample as a filter had it; empty: none known
    settled: state -> value at the first sample of a loop that had settled by then; empty: at rest
    unsure: state -> standard deviation of what is not known of it there, of a machine that was on
    """

    record: Record
    sampled: Any
    channels: tuple[str, ...]
    kinds: tuple[str, ...]
    steps: tuple[float, ...]
    measured: Array
    begins: tuple[Mapping[str, float], ...] = ({},)
    settled: Mapping[str, float] = field(default_factory=dict)
    unsure: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Of the record."""
        return self.record.name

    def initial(self, core: Any, offsets: Mapping[str, float]) -> list[dict[str, float]]:
        """State at the first sample of every stretch.

        As a filter had it before, else as a settled loop has it, else as the encoders have it, less
        what they and the laws at them add.
        """
        known = frozenset(state for state, _ in core.states())
        if followed := self._followed(known):
            return [dict(own) for own in followed]
        joints = _joints(core, known)
        told = {s: x for s, x in self.record.initial.items() if s in known}
        settled = {s: x for s, x in self.settled.items() if s in known}
        found = []
        for first, before in zip(self._first(core, offsets), self.begins, strict=True):
            own = {**told, **_seen(first, told, joints, known), **settled}
            own |= {s: x for s, x in before.items() if s in known}
            found.append(_joined(own, joints))
        return found

    def _followed(self, known: frozenset[str]) -> list[dict[str, float]]:
        """What a filter had of these states at every stretch; empty: not all of them."""
        if known not in self._covered:
            every = all(known <= before.keys() for before in self.begins)
            own = [{s: before[s] for s in known} for before in self.begins] if every else []
            self._covered[known] = own
        return self._covered[known]

    @functools.cached_property
    def _covered(self) -> dict[frozenset[str], list[dict[str, float]]]:
        """States of machines that were replayed -> `_followed`: searches ask for the same."""
        return {}

    def _first(self, core: Any, offsets: Mapping[str, float]) -> list[dict[str, float]]:
        """Channel -> its reading at the first sample of every stretch, sensors' laws taken back."""
        readings = self.measured[self.sampled.starts]
        first = {c: y - offsets.get(c, 0.0) for c, y in zip(self.channels, readings.T, strict=True)}
        for c in self.channels:
            if not c.startswith("theta_"):
                continue
            if places := [p for p in _places(core, c) if reads(core, p)]:
                first[c] = read_at(core, places, first[c])
        rows = zip(*(y.tolist() for y in first.values()), strict=True)
        return [dict(zip(first, row, strict=True)) for row in rows]

    def stretches(
        self, which: Sequence[tuple[int, int]], begins: Sequence[Mapping[str, float]]
    ) -> Predictable:
        """Stretches of it, (first sample, how many), each with the state at its first sample."""
        rows = np.concatenate([np.arange(first, first + count) for first, count in which])
        return replace(
            self,
            sampled=self.sampled.stretches(list(which)),
            measured=np.ascontiguousarray(self.measured[rows]),
            begins=tuple(begins),
        )


class _Joint(NamedTuple):
    """Between table and a motor: names of its states and channels, and how it is geared.

    gearbox: (twist, ratio, winding, stiffness, half play) of one that has a twist; N*m/A at its
        output, N*m/rad, rad
    """

    motor: str
    mesh: str
    to_table: float
    to_motor: float
    gearbox: tuple[str, float, float, float, float] | None


def _joints(core: Any, known: frozenset[str]) -> list[_Joint]:
    found = []
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        mesh, gearbox = f"mesh_{n}.twist", f"gearbox_{n}"
        geared = gearbox in core.connections
        ratio = core.get(f"{gearbox}.ratio") if geared else 1.0
        own = None
        if f"{gearbox}.twist" in known:
            winding = ratio * core.get(f"{motor}.K_d")
            stiffness, play = core.get(f"{gearbox}.stiffness"), core.get(f"{gearbox}.gap")
            own = f"{gearbox}.twist", ratio, winding, stiffness, play
        to_table = core.get(f"mesh_{n}.ratio") if mesh in known else 1.0
        found.append(_Joint(n, mesh, to_table, ratio, own))
    return found


def _seen(
    first: Mapping[str, float],
    told: Mapping[str, float],
    joints: Sequence[_Joint],
    known: frozenset[str],
) -> dict[str, float]:
    """The angles as the encoders have them."""
    table = first.get("theta_m", told.get("theta_m", 0.0))
    found = {"theta_m": table} if "theta_m" in known else {}
    for joint in joints:
        if joint.mesh not in known:
            continue
        angle = first.get(f"theta_c{joint.motor}")
        if angle is None and f"theta_{joint.motor}" in first:
            angle = first[f"theta_{joint.motor}"] / joint.to_motor
        if angle is not None:
            found[joint.mesh] = angle - joint.to_table * table
    return found


def _joined(state: dict[str, float], joints: Sequence[_Joint]) -> dict[str, float]:
    """A state in which motors turn with their pinions, where a joint that nobody knew of is new.

    The joint is wound up by what its motor gives, through its play if it has one; the angles that
    encoders see stay as they are.
    """
    for joint in joints:
        pinion = f"omega_c{joint.motor}"
        if joint.gearbox is None or joint.gearbox[0] in state or pinion not in state:
            continue
        own, ratio, winding, stiffness, play = joint.gearbox
        wound = winding * state.get(f"I_{joint.motor}", 0.0)
        twist = wound / stiffness + math.copysign(play, wound)
        state |= {f"omega_{joint.motor}": ratio * state[pinion], own: twist}
        state[joint.mesh] = state.get(joint.mesh, 0.0) - twist
    return state


def predictable(core: Any, records: Sequence[Record]) -> list[Predictable]:
    """Make records ready.

    Raises:
        ReplayError: a record none of whose channels the machine has.

    """
    found = [_predictable(core, record) for record in records]
    # alike beginnings have gains in common: of loops that had settled the least sure tells
    unsure: dict[str, float] = {}
    for r in found:
        for state, deviation in r.unsure.items():
            unsure[state] = max(deviation, unsure.get(state, 0.0))
    return [replace(r, unsure=unsure) if r.settled else r for r in found]


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
    settled, unsure = _settled(core, record, "theta_m" in channels)
    return Predictable(
        record,
        _core.SampledRecord(dict(record.inputs), np.ascontiguousarray(record.t), places, measured),
        tuple(channels),
        tuple(map(_noise_kind, channels)),
        tuple(_step(trace[c]) for c in channels),
        measured,
        settled=settled,
        unsure=unsure,
    )


def _settled(core: Any, record: Record, seen: bool) -> tuple[dict[str, float], dict[str, float]]:
    """What a machine that was on before has at the first sample, and how far that is from sure.

    Tension and wound-up shafts: as they stand once all has settled. When it was switched on nobody
    recorded, and the tension may take longer: the controller's states may be off by as much as they
    were on the way there. Angles that were are left to the encoders, and so is the table's where it
    is seen.
    """
    if record.start != "settled":
        return {}, {}
    own = with_settings(core, record.settings)
    first, state = float(record.t[0]), dict(record.initial)
    begin, ways = record.begin, list[dict[str, float]]()
    for k in range(_LOOKS, -1, -1):
        end = first - (first - record.begin) * (1.0 - 0.5**k)
        run = _core.simulate(
            own, dict(record.inputs), start=begin, end=end, times=[end], signals=[], initial=state,
            energy=False,
        )  # fmt: skip
        if run.status != "success":
            return {}, {}
        begin, state = end, dict(zip(run.state_names, map(float, run.final_state), strict=True))
        ways.append(state)
    left = ("controller.encoder_", *(("theta_m",) if seen else ()))
    found = {s: x for s, x in state.items() if not s.startswith(left)}
    off = {s: max(abs(way[s] - x) for way in ways) for s, x in found.items()}
    # to two digits: records of one kind have the same gains
    rounded = {s: float(f"{x:.1e}") for s, x in off.items() if s.startswith("controller.")}
    return found, {s: x for s, x in rounded.items() if x > 0.0}


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
    finest = float(f"{np.min(distances[distances > 1e-12 * np.ptp(values)]):.6g}")
    whole = (values - values[0]) / finest
    return finest if np.mean(np.abs(whole - np.round(whole)) < 0.05) > 0.95 else 0.0
