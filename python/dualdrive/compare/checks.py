"""What is wrong with a record itself, before any physics is blamed for it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.clocks import clock_of
from dualdrive.compare.noise import noise_floor
from dualdrive.compare.signs import torques_fit, train_fits
from dualdrive.compare.time_skew import skews
from dualdrive.identify import with_torques
from dualdrive.replay import core_of, named
from dualdrive.traces import CHANNELS, Trace

Array = NDArray[np.float64]

_RUN, _CLIPPED = 5, 0.005  # samples in a run at an extreme; share of the record in such runs
_MUCH = 0.05  # of the record: an angle at the end of its range for so long spoils it
_LEVELS = 20  # a channel of fewer levels sits at an extreme by rounding
_MOVES = 0.05  # of the highest speed
_FOLLOWS = 0.2  # of the command, by which the table's travel may differ without a word
_FOREIGN = 3.0  # times the command, or less than its third: no control loop that keeps up with it
_SAME_COURSE = 0.8  # correlation with the command from which the table keeps up with its course
_FEWEST = 200  # samples
_FEWEST_MOVING = 50


@dataclass(frozen=True)
class RecordWarning:
    """Something amiss with a record.

    code:  still, short, one_way, constant, clipped, ratio, swapped, sign, scale, command, skew,
           jitter
    fatal: nothing that is concluded from the record would hold
    """

    code: str
    trace: str
    message: str
    fatal: bool


#: code, message, fatal
Finding = tuple[str, str, bool]


def check_records(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    mode: str = "auto",
    threads: int | None = None,
) -> list[RecordWarning]:
    """Look for what would mislead a comparison: foreign, swapped, flipped, clipped, late channels.

    Args:
        machine: a machine, or the core's.
        traces: one trace, several, or name -> trace.
        mode: ``closed_loop`` looks at the command, too.
        threads: records side by side; as many as there are cores unless given.

    Returns:
        Warnings whose message names the trace, the channel, what was seen and what to do; none for
        a record in order.

    """
    core = core_of(machine)

    def check(item: tuple[str, Trace]) -> list[RecordWarning]:
        name, trace = item
        own = _all(core, name, trace, mode)
        return [RecordWarning(code, name, f"{name}: {said}", fatal) for code, said, fatal in own]

    # in the order of the traces, errors as well
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        return list(chain(*pool.map(check, named(traces).items())))


def _all(core: Any, name: str, trace: Trace, mode: str) -> Iterator[Finding]:
    if len(trace) < _FEWEST:
        rule = f"{len(trace)} samples are too few to tell one cause from another"
        yield "short", f"{rule}; record longer, at least {_FEWEST}", True
        return
    yield from _constant(trace)
    if still := list(_still(trace)):
        yield from still
        return
    yield from _short(trace)
    yield from _clipped(trace)
    if mode == "closed_loop":
        yield from _command(trace)
    driven = with_torques(core, trace)
    broken = list(train_fits(core, driven))
    yield from broken
    if not any(fatal for _, _, fatal in broken):
        yield from torques_fit(core, driven)
        for skew in skews(core, {name: trace}):
            if skew.significant:
                yield "skew", skew.message.partition(": ")[2], False
    yield from _jitter(trace)


# --- what one channel shows by itself -------------------------------------------------------------


def _known(trace: Trace, *stems: str) -> list[str]:
    return [c for c in trace if c in CHANNELS and c.startswith(stems)]


def _constant(trace: Trace) -> Iterator[Finding]:
    for channel in _known(trace, "theta_m", "theta_1", "theta_2", "theta_c", "omega_", "I_", "T_"):
        if np.ptp(trace[channel]) == 0.0 and channel not in ("T_load", "omega_ref"):
            value = f"{trace[channel][0]:.4g}"
            yield (
                "constant",
                f"{channel} reads {value} throughout; leave it out of the mapping or mend its "
                "sensor",
                False,
            )


def _still(trace: Trace) -> Iterator[Finding]:
    angles = [c for c in _known(trace, "theta_") if c != "theta_ref"]
    speeds = [c for c in _known(trace, "omega_") if c != "omega_ref"]
    seen = angles or speeds
    if seen and all(np.ptp(trace[c]) <= 12.0 * _noise(trace, c) for c in seen):
        yield (
            "still",
            f"nothing moves: {', '.join(seen)} stay within their noise; record a motion",
            True,
        )


def _noise(trace: Trace, channel: str) -> float:
    return noise_floor(trace.t, trace[channel]).rms


def _short(trace: Trace) -> Iterator[Finding]:
    speed = speed_of(trace)
    if speed is None:
        return
    moving = np.abs(speed) > _MOVES * np.max(np.abs(speed))
    if moving.sum() < _FEWEST_MOVING:
        yield (
            "short",
            f"{len(trace)} samples, {int(moving.sum())} of them in motion: too few to tell one "
            "cause from another; record longer",
            True,
        )
    signs = np.sign(speed[moving])
    if len(signs) and np.all(signs == signs[0]):
        yield (
            "one_way",
            "it moves one way only, so that friction, a constant torque and gravity look alike; "
            "record a way back",
            False,
        )


def speed_of(trace: Trace) -> Array | None:
    """A speed that all bodies share but for ratios: of the table where it is recorded."""
    for angle in ("theta_m", "theta_c1", "theta_1", "theta_2", "theta_ref"):
        if angle in trace:
            wide = max(1, round(len(trace) / 2000))
            return np.concatenate([_smooth_rate(p.t, p[angle], wide) for p in trace.segments(1)])
    for name in ("omega_m", "omega_1"):
        if name in trace:
            return trace[name]
    return None


def _smooth_rate(t: Array, values: Array, wide: int) -> Array:
    """Slope of the mean of so many samples on either side, shape (n,); 0 where there are fewer."""
    if len(t) < 2 * wide + 2:
        return np.zeros(len(t))
    smooth = np.convolve(values, np.ones(2 * wide + 1) / (2 * wide + 1), "valid")
    return np.pad(np.gradient(smooth, t[wide : len(t) - wide]), wide, mode="edge")


def _clipped(trace: Trace) -> Iterator[Finding]:
    for channel in _known(trace, "I_", "T_", "U_"):
        values = trace[channel]
        if channel == "T_load" or len(np.unique(values)) < _LEVELS:
            continue
        for extreme in (float(np.max(values)), float(np.min(values))):
            at = values == extreme
            share = float(np.mean(_in_runs(at)))
            if share >= _CLIPPED:
                yield (
                    "clipped",
                    f"{channel} stands at {extreme:.5g} for {share:.1%} of the record, as a sensor "
                    "at the end of its range or a drive at its limit does; leave those stretches "
                    "out, or give the machine that limit",
                    False,
                )
    for channel in _known(trace, "theta_"):
        values = trace[channel]
        others = [c for c in _known(trace, "theta_") if c not in (channel, "theta_ref")]
        if channel == "theta_ref" or not others or len(np.unique(values)) < _LEVELS:
            continue
        ends = (values == np.max(values)) | (values == np.min(values))
        moving = np.any([_turns(trace[c]) for c in others], axis=0)
        share = float(np.mean(_in_runs(ends) & moving))
        if share >= _CLIPPED:
            yield (
                "clipped",
                f"{channel} stands at the end of its range for {share:.1%} of the record while "
                f"{', '.join(others)} move; leave those stretches out",
                share > _MUCH,  # a drive that rests in wide play does so for a moment
            )


def _turns(angle: Array) -> NDArray[np.bool_]:
    """Samples about which an angle moves clearly."""
    rate = np.abs(angle[2 * _RUN :] - angle[: -2 * _RUN])
    return np.pad(rate > 0.2 * np.max(rate), _RUN)


def _in_runs(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Flags that stand in runs of five and more."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    kept = np.zeros(len(flags), dtype=bool)
    for start, end in edges.reshape(-1, 2):
        if end - start >= _RUN:
            kept[start:end] = True
    return kept


def _command(trace: Trace) -> Iterator[Finding]:
    if "theta_ref" not in trace or "theta_m" not in trace or np.ptp(trace["theta_ref"]) == 0.0:
        return
    reference, measured = trace["theta_ref"], trace["theta_m"]
    slope = float(np.polyfit(reference - reference.mean(), measured - measured.mean(), 1)[0])
    if abs(slope - 1.0) > _FOLLOWS:
        # a loop may enlarge what comes at its resonance, thrice on average none; one that is slow
        # beside the motion lags far behind, but no unit makes a course another one
        alike = abs(slope) * np.std(reference) > _SAME_COURSE * np.std(measured)
        ordinary = 1.0 / _FOREIGN < slope < _FOREIGN
        foreign = bool(not ordinary and (alike or slope >= _FOREIGN))
        if foreign:
            why = "a unit or a sign is wrong in one of them, see the mapping"
        elif ordinary:
            why = "a loop does so near its resonance; else a unit is wrong in one of them"
        else:
            why = "a loop that is slow beside the motion does so; else it is another record's"
        yield "command", f"theta_m moves {slope:.3g} times as far as theta_ref; {why}", foreign


def _jitter(trace: Trace) -> Iterator[Finding]:
    clock = clock_of(trace)
    for channel in _known(trace, "theta_m", "theta_1", "theta_c1") if clock.wrong else ():
        if clock.noise(trace.t, trace[channel]) > _noise(trace, channel):
            yield "jitter", clock.message.partition(": ")[2], False
            return
