"""One stretch of a trace, made ready to be played through a machine's closed loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.assembly import core_of
from dualdrive.replay.channels import Compared, compared_channels, ratio_to_table
from dualdrive.traces import CHANNELS, Trace

Array = NDArray[np.float64]

#: how the machine stands when a record begins
STARTS = ("auto", "rest", "settled")
INTERPOLATIONS = ("auto", "cubic", "linear", "hold")
_DIED_AWAY = 18.5  # time constants after which 1e-8 is left, as accurate as a replay is
_LONGEST = 120.0  # s: a loop that takes longer to settle drifts, and so does the machine
_FREE = 1e-7  # of the fastest pole: as good as zero
_HALVINGS = 8  # of the time a loop takes to settle: how long ago it may have been switched on
_WORSE = 2  # of them in a row that are farther off than the best: longer ones are, too
_CLEARLY = 0.9  # times what another start leaves: the one that is taken leaves less
_SHORTEST = 16  # samples; a shorter stretch between two breaks says nothing


class ReplayError(ValueError):
    """A trace that can't be played through this machine; the message says what is missing."""


@dataclass(frozen=True, eq=False)
class Record:
    """A stretch without pauses: inputs, initial state and the channels it is held against.

    t:         times of the samples, s
    inputs:    name -> waveform, as `_core.simulate` takes them
    initial:   state -> value at `begin`, others zero
    begin:     time at which the simulation starts: t[0], or earlier to let the loop settle
    start:     rest | settled: how the machine stood before
    reference: commanded table angle at t
    left_out:  samples of the trace in stretches too short to play
    settings:  parameter path -> value that held while it was recorded, over the machine's own
    """

    name: str
    t: Array
    inputs: Mapping[str, Any]
    initial: Mapping[str, float]
    begin: float
    start: str
    reference: Array
    channels: tuple[Compared, ...]
    trace: Trace
    left_out: int = 0
    settings: Mapping[str, float] = field(default_factory=dict)

    def channel(self, name: str) -> Compared:
        """The compared channel of that name."""
        return next(c for c in self.channels if c.name == name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the compared channels."""
        return tuple(c.name for c in self.channels)

    @property
    def moves_at_once(self) -> bool:
        """Whether the command moves from the first sample on."""
        steps = np.abs(np.diff(self.reference))
        return bool(steps[0] > 1e-3 * np.max(steps))


def with_settings(core: Any, settings: Mapping[str, float]) -> Any:
    """The core's machine as it was set while a record was taken: a copy, or itself without any."""
    if not settings:
        return core
    own = core.copy()
    for path, value in settings.items():
        own.set(path, value)
    return own


def records(
    machine: Any,
    traces: Mapping[str, Trace],
    *,
    motion: Any = None,
    interpolation: str = "auto",
    start: str = "auto",
    settings: Mapping[str, Mapping[str, float]] | None = None,
) -> list[Record]:
    """Make every stretch of every trace ready.

    Args:
        machine: with a controller.
        traces: name -> trace.
        motion: the commanded motion (a waveform, or anything with a ``waveform``) where the traces
            carry no ``theta_ref``.
        interpolation: of recorded inputs between samples: ``cubic`` where the reference is smooth
            and ``linear`` where it is not, unless told; a sampled loop reads it at its ticks.
        start: ``rest`` (drives switched on at the first sample), ``settled`` (the loop had long
            held the first position, or followed the line on which the command comes in), or
            ``auto``: whichever meets the first second better, and of a loop that was switched
            on before, how long ago, where the whole record says so.
        settings: name of a trace -> parameter path -> SI value that held while it was recorded,
            such as ``controller.T_ten``.

    Raises:
        ValueError: settings for a trace that is not there, or of an unknown path.
        ReplayError: no controller, no commanded motion, or nothing recorded to compare with.

    """
    core = core_of(machine)
    for value, known, what in (
        (interpolation, INTERPOLATIONS, "interpolation"),
        (start, STARTS, "start"),
    ):
        if value not in known:
            raise ReplayError(f"{what} = {value!r}; choose one of {', '.join(known)}")
    if core.controller_options["kind"] == "none":
        raise ReplayError(
            "the machine has no controller to close the loop with; use the torque balance"
        )
    if stray := set(settings or {}) - set(traces):
        raise ReplayError(
            f"settings: no trace {', '.join(sorted(stray))}; there are {', '.join(traces)}"
        )
    found = []
    for name, trace in traces.items():
        own = dict((settings or {}).get(name, {}))
        parts = trace.segments(_SHORTEST)
        if not parts:
            rule = f"none of its {len(trace)} samples stand in {_SHORTEST} or more without a pause"
            raise ReplayError(f"{name}: {rule}; record longer, or without gaps")
        left_out = len(trace) - sum(len(part) for part in parts)
        for k, part in enumerate(parts, 1):
            label = name if len(parts) == 1 else f"{name} ({k})"
            record = _record(with_settings(core, own), label, part, motion, interpolation, start)
            found.append(replace(record, left_out=left_out if k == 1 else 0, settings=own))
    return found


def _record(
    core: Any, name: str, trace: Trace, motion: Any, interpolation: str, start: str
) -> Record:
    inputs = _inputs(core, name, trace, motion, interpolation)
    reference = np.asarray(inputs["theta_ref"].value(trace.t))
    channels = compared_channels(core, trace, reference)
    if not channels:
        raise ReplayError(
            f"{name}: no channel that the machine simulates varies; "
            f"there are {', '.join(trace) or 'none'}"
        )
    begin = float(trace.t[0])
    record = Record(name, trace.t, inputs, {}, begin, "rest", reference, tuple(channels), trace)
    at_rest = replace(record, initial=_state_at_start(core, record))
    if start == "rest":
        return at_rest
    before = partial(_switched_on, core, record, extend=motion is None)
    settled = before(_settling_time(core))
    if start == "settled":
        return settled
    better = _better_start(core, at_rest, settled)
    return _lately_switched_on(core, settled, before) if better is settled else better


def _switched_on(core: Any, record: Record, time: float, *, extend: bool) -> Record:
    """The same after the loop had time to settle on the line that leads into the record.

    time: since the drives were switched on, s; whole samples of the controller's loops
    extend: the command is a recording, which says nothing of the time before
    """
    time, t0 = _in_whole_samples(core, time), float(record.t[0])
    command = record.inputs["theta_ref"]
    if extend and record.moves_at_once:
        rate = float(command.rate(t0))
        line = [_core.ramp(rate, t0 - time, t0), _core.constant(-rate * time)]
        command = _core.sum([command, *line])
    begin = t0 - time
    speeds = _speeds(core, float(command.rate(begin)))
    initial = {"theta_m": float(command.value(begin)), **speeds}
    known = dict(core.states())
    return replace(
        record,
        inputs={**record.inputs, "theta_ref": command},
        begin=begin,
        start="settled",
        initial={state: value for state, value in initial.items() if state in known},
    )


def _lately_switched_on(core: Any, settled: Record, before: Callable[[float], Record]) -> Record:
    """The same, its drives switched on less long ago, where the record says so clearly.

    The slowest motions of a loop, that of its tension as a rule, take many seconds to die away.
    They show over the whole record, where a law that is missing shows at any time alike.

    before: time since the drives were switched on, s -> the record
    """
    from scipy.optimize import minimize_scalar

    longest, found = float(settled.t[0]) - settled.begin, dict[float, float]()
    for k in range(_HALVINGS, 0, -1):
        found[longest / 2.0**k] = _misfit(core, before(longest / 2.0**k))
        nearest = min(found, key=lambda time: found[time])
        if len(found) - list(found).index(nearest) > _WORSE:
            break
    if not found[nearest] < _CLEARLY * _misfit(core, settled):
        return settled
    at_best = minimize_scalar(
        lambda x: _misfit(core, before(math.exp(x))),
        bounds=(math.log(0.5 * nearest), math.log(2.0 * nearest)),
        method="bounded",
        options={"xatol": 0.02, "maxiter": 20},
    )
    return before(math.exp(at_best.x) if at_best.fun < found[nearest] else nearest)


def _better_start(core: Any, *candidates: Record) -> Record:
    """The one that lies nearer to the record at first; the first where neither runs.

    Judged by what comes before the command moves, where that is long enough, else by the first
    second: once it moves, a wrong inertia weighs more than flanks that stood open.
    """
    best, least = candidates[0], math.inf
    for record in candidates:
        if (size := _misfit(core, record, _beginning(record))) < _CLEARLY * least:
            best, least = record, size
    return best


def _misfit(core: Any, record: Record, samples: int | None = None) -> float:
    """Mean square of what a replay leaves of so many samples, over spreads; infinite: it fails."""
    from dualdrive.replay.run import play

    first = replace(record, t=record.t[:samples])
    replay = play(core, first)
    if not replay.ok:
        return math.inf
    n = len(first.t)
    off = [
        float(np.mean((r - c.floating * np.median(r)) ** 2)) / c.spread**2
        for c in record.channels
        if c.headline
        for r in [replay.simulated[c.name] - c.measured[:n]]
    ]
    return float(np.mean(off)) if off else 0.0


def _beginning(record: Record) -> int:
    """Samples that tell how the machine stood."""
    second = max(_SHORTEST, int(np.sum(record.t < record.t[0] + 1.0)))
    off = np.abs(record.reference - record.reference[0]) > 1e-3 * np.ptp(record.reference)
    still = int(np.argmax(off)) if off.any() else len(record.t)
    return min(still, second) if still >= _SHORTEST else second


def _settling_time(core: Any) -> float:
    """Until the slowest motion of the closed loop has died away, at least 2 s.

    Poles of the whole loop, position loop and equaliser among them; of a loop that does not settle
    by itself, and of one whose poles are not known, the longest of the controller's own times.
    """
    slow = max(core.get(f"controller.{n}") for n in ("T_N", "T_E", "tau_t"))
    rate = _slowest_decay(core)
    settled = _DIED_AWAY / rate if rate > 0.0 else 20.0 * slow
    return min(max(2.0, settled), _LONGEST)


def _in_whole_samples(core: Any, time: float) -> float:
    """A time, s, prolonged to the next tick of the slowest of the sampled loops."""
    samples: list[float] = [
        core.get(f"controller.{n}_sample") for n in ("position", "tension", "speed", "current")
    ]
    whole = max([s for s in samples if s > 0], default=1e-3)
    return float(whole * math.ceil(time / whole))


def _slowest_decay(core: Any) -> float:
    """How fast the slowest motion of the closed loop dies away, 1/s; 0 where it does not."""
    from dualdrive.linear import LinearError, poles

    try:
        found = poles(core)
    except (LinearError, ValueError):
        return 0.0
    held = found[np.abs(found) > _FREE * np.abs(found).max(initial=0.0)]  # an angle nothing holds
    return max(float(np.min(-held.real, initial=math.inf)), 0.0) if held.size else 0.0


def _state_at_start(core: Any, record: Record) -> dict[str, float]:
    """Angle and, where the record begins in motion, speeds and currents from its first samples."""
    trace, states = record.trace, dict(core.states())
    moving = record.moves_at_once
    initial: dict[str, float] = {}
    if "theta_m" in trace and "theta_m" in states:
        initial["theta_m"], speed = _first(trace.t, trace["theta_m"], moving)
    else:
        speed = _first(record.t, record.reference, moving)[1]
    if not moving:
        return initial
    currents = {s: float(trace[s][0]) for s in states if s.startswith("I_") and s in trace}
    return {**initial, **_speeds(core, speed), **currents}


def _speeds(core: Any, speed: float) -> dict[str, float]:
    """Speed of every body that is a state while the table turns at `speed`, nothing if it rests."""
    states = [state for state, _ in core.states() if state.startswith("omega_")]
    return {s: speed * ratio_to_table(core, _body(s)) for s in states} if speed != 0.0 else {}


def _body(state: str) -> str:
    """The body whose speed a state is: omega_c1 is that of pinion_1."""
    suffix = state.removeprefix("omega_")
    if suffix.isdigit():
        return f"motor_{suffix}"
    return f"pinion_{suffix[1:]}" if suffix.startswith("c") and suffix[1:].isdigit() else "table"


def _first(t: Array, values: Array, moving: bool) -> tuple[float, float]:
    """Value and slope at the first sample, from a parabola through the first ten; at rest, 0."""
    n = min(10, len(t))
    if not moving:
        return float(np.mean(values[: min(5, n)])), 0.0
    _, slope, value = np.polyfit(t[:n] - t[0], values[:n], 2)
    return float(value), float(slope)


def _inputs(core: Any, name: str, trace: Trace, motion: Any, interpolation: str) -> dict[str, Any]:
    """Commanded motion, recorded load, and the columns that a user's law reads."""
    inputs: dict[str, Any] = {}
    if motion is not None:
        inputs["theta_ref"] = getattr(motion, "waveform", motion)
    elif "theta_ref" in trace:
        inputs["theta_ref"] = waveform(trace.t, trace["theta_ref"], interpolation)
    else:
        raise ReplayError(
            f"{name}: no commanded motion; record theta_ref, give a motion, or use the torque "
            "balance"
        )
    read = {name.removeprefix("in.") for effect in core.effects for name in effect["reads"]}
    for channel in trace:
        if channel == "T_load" or (channel in read and channel not in CHANNELS):
            inputs[channel] = _core.sampled(trace.t, trace[channel], _core.Interpolation.linear)
    return inputs


def waveform(t: Array, values: Array, interpolation: str = "auto") -> Any:
    """A recorded signal between its samples; see `records` for the choices."""
    if interpolation == "auto":
        interpolation = "cubic" if _is_smooth(t, values) else "linear"
    if (
        interpolation == "hold"
    ):  # a tick that falls on a sample, rounding included, reads that sample
        t = t - 1e-6 * np.min(np.diff(t))
    return _core.sampled(t, values, getattr(_core.Interpolation, interpolation))


def _is_smooth(t: Array, values: Array) -> bool:
    """Whether accelerations change from sample to sample by less than they are.

    A corner between two ramps is one sample's acceleration and none at the next, and so is the
    rounding of a coarse command: a cubic through either swings about it.
    """
    if len(t) < 9 or np.ptp(values) == 0.0:
        return True
    acceleration = np.diff(np.diff(values) / np.diff(t))
    change = np.diff(acceleration)
    return bool(change @ change < acceleration @ acceleration)


def named(traces: Any) -> dict[str, Trace]:
    """Name -> trace, names unique; one trace, several, or a mapping."""
    if isinstance(traces, Mapping):
        return dict(traces)
    several: Sequence[Trace] = [traces] if isinstance(traces, Trace) else list(traces)
    if not several:
        raise ReplayError("no trace given; give at least one")
    names = [trace.name for trace in several]
    if len(set(names)) < len(names):
        names = [f"{name} ({k})" for k, name in enumerate(names, 1)]
    return dict(zip(names, several, strict=True))
