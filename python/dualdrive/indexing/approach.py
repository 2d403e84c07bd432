"""One target approached from both sides, and where the table stands after it is in position.

Targets differ by the twists that pitch errors start their meshes with. Their runs pause after the
first two moves, and those whose states have met by then go on as one. Two motors that press their
pinions on by torque have forgotten such a twist by the first or second pause; a shaft that is wound
up between its pinions keeps it, and its targets never meet.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.indexing.error_budget import Draw
from dualdrive.machine import Machine
from dualdrive.simulation import simulate

__all__ = [
    "DELAYS",
    "DWELL",
    "FROM",
    "LIMITS",
    "REPEATS",
    "START",
    "Reading",
    "looks",
    "read",
    "readings",
]

Floats = NDArray[np.float64]

#: s from in position to the reading
DELAYS: Final = (0.5, 1.0, 1.5, 2.0, 3.0, 5.0)
#: cycles in both directions
REPEATS: Final = 3
#: rad: from where a target is approached
FROM: Final = 0.03
#: s: of rest before the first move, and at every target
START, DWELL = 1.5, 6.0
#: of the moves: rad/s, rad/s^2, rad/s^3
LIMITS: Final = (0.05, 0.01, 0.05)

_TURN: Final = 0.5  # s: of rest where it turns back
_STEP, _WINDOW = 0.1, 0.2  # s: between looks; averaged per reading
_RTOL = 1e-7
_SIGNALS: Final = ("theta_m", "sensed.table")
# states have met: angles and speeds, and what is stored in drives, SI; or by a share of their size
_MOTION, _STORED, _SHARE = 1e-8, 1e-5, 1e-6


@dataclass(frozen=True)
class Reading:
    """What was read at one delay, rad; NaN where the table was not in position in time.

    off:    deviation from the target
    moved:  by how much the table moved between the looks that are averaged
    """

    off: Floats
    moved: Floats


def readings(
    machine: Machine, drawn: Draw, starts: Sequence[Mapping[str, float]]
) -> dict[float, Reading]:
    """Delay -> reading of each target, of shape (starts, REPEATS, 2): upwards, downwards.

    starts:  per target: the twists of its meshes

    NaN, too, where a run failed.
    """
    waveform, stops, pauses = _to_and_fro()
    times = looks(stops).ravel()
    seen = np.full((len(starts), len(_SIGNALS), times.size), np.nan)
    states: list[Mapping[str, float]] = list(starts)
    for begin, end in pairwise(_ticks(machine, pauses)):
        rows = np.flatnonzero((times >= begin) & (times < end))
        for group in _met(states):
            run = simulate(
                machine,
                inputs={"theta_ref": waveform},
                start=begin,
                end=end,
                signals=_SIGNALS,
                times=[*times[rows], end],
                energy=False,
                rtol=_RTOL,
                initial=states[group[0]],
            )
            for k in group:
                states[k] = run.final_state
                if run.ok:
                    seen[k][:, rows] = [run[name][:-1] for name in _SIGNALS]
    shape = looks(stops).shape
    found = [
        read(true.reshape(shape), sensed.reshape(shape), stops, drawn) for true, sensed in seen
    ]

    def together(values: Iterable[Floats]) -> Floats:
        return np.array([*values]).reshape(-1, REPEATS, 2)

    return {
        d: Reading(together(one[d].off for one in found), together(one[d].moved for one in found))
        for d in DELAYS
    }


def looks(stops: Floats) -> Floats:
    """When the table is looked at in its dwells, s, shape (stops, looks)."""
    return np.asarray(stops[:, 1][:, None] + _since())


def read(true: Floats, sensed: Floats, stops: Floats, drawn: Draw) -> dict[float, Reading]:
    """Delay after in position -> reading in each dwell, of shape (dwells,).

    true, sensed:  the table and what its control sees of it at `looks`, rad
    stops:         (target, begin, end) of the dwells, rad and s, shape (n, 3)
    """
    since = _since()
    deviation = true - stops[:, :1]
    within = np.abs(sensed - stops[:, :1]) <= drawn["in-position window"]
    arrived = np.where(within.any(axis=1), since[within.argmax(axis=1)], np.inf)
    found = {}
    for delay in DELAYS:
        begin = (arrived + delay)[:, None]
        rows = (since >= begin - 1e-9) & (since < begin + _WINDOW - 1e-9)
        in_time = begin[:, 0] + _WINDOW <= DWELL + 1e-9
        count = np.maximum(rows.sum(axis=1), 1)
        mean = np.where(rows, deviation, 0.0).sum(axis=1) / count
        highest = np.where(rows, deviation, -np.inf).max(axis=1)
        lowest = np.where(rows, deviation, np.inf).min(axis=1)
        found[delay] = Reading(*(np.where(in_time, x, np.nan) for x in (mean, highest - lowest)))
    return found


def _since() -> Floats:
    return np.arange(0.0, DWELL - 1e-9, _STEP)


@cache
def _to_and_fro() -> tuple[_core.Waveform, Floats, tuple[float, ...]]:
    """The command; (target, begin, end) of its dwells; begin, pauses and end of the run, s."""
    moves, stops, rests, place = [], [], [START], 0.0
    for turn in [-FROM, *[0.0, FROM, 0.0, -FROM] * REPEATS]:
        # each move adds its own way to all those before it
        moves.append(_core.jerk_limited_move(turn - place, *LIMITS, start=rests[-1]))
        arrived, place = moves[-1].end(), turn
        rests.append(arrived + (_TURN if turn else DWELL))
        if not turn:
            stops.append((0.0, arrived, rests[-1]))
    return _core.sum(moves), np.array(stops), (0.0, *rests[1:3], stops[-1][2])


def _ticks(machine: Machine, times: Sequence[float]) -> list[float]:
    """These times at ticks of the position loop, where a run may be taken up again."""
    sample = machine.get("controller.position_sample")
    return [sample * math.ceil(time / sample) for time in times]


def _met(states: Sequence[Mapping[str, float]]) -> list[list[int]]:
    """Which of these states are the same to all intents: their indices, group by group."""
    names = list(states[0])
    stored = [name.startswith(("controller.", "I_")) for name in names]
    least = np.where(stored, _STORED, _MOTION)
    values = np.array([[state[name] for name in names] for state in states])
    groups: list[list[int]] = []
    for k, value in enumerate(values):
        for group in groups:
            first = values[group[0]]
            if (np.abs(value - first) <= least + _SHARE * np.abs(first)).all():
                group.append(k)
                break
        else:
            groups.append([k])
    return groups
