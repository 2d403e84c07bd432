"""Torques and readings of no law: what each would change of every series.

A short pulse of torque every so often, at the table or at a motor, put into the refitted machine,
tells how its series answer while it moves; a torque of any course is a sum of such pulses. Courses
that a law could take are tried: in time, along the angle, over the speed, over the drive's own
current or torque, with the past acceleration (a mass or a foundation that gives), as a tone, a few
times per turn of a motor; and readings that grow in time or take from one another. Where the
machine sticks or a flank opens the answer is not the true one: a course may go unseen there, but
noise is no likelier to follow it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.refit import Refit
from dualdrive.replay import ratio_to_table

Array = NDArray[np.float64]

#: what a course follows
Kind = Literal[
    "time", "angle", "speed", "acceleration", "frequency", "drive torque", "turns", "readings"
]
_WIDTH = 0.004  # s between two knots of a pulse, at least
_SAMPLES = 2.0  # sampling intervals, the same
_BETWEEN = 0.5  # s between two pulses
_PULSES = 8  # in the longest record, at least
_KNOTS = 12  # from one pulse to the next, at least
_OF_TORQUE = 0.2  # of the drives': height of a pulse
_MOVING = 0.2  # of the largest speed under a pulse: less tells of sticking
_SMOOTH = 0.012  # s: over which the table's speed and acceleration are read
_IN_TIME = 10  # knots of a curve in time, of each record
_ALONG = 12  # knots of a curve along the travel
_SPEEDS = (-1.0, -0.66, -0.33, -0.08, 0.08, 0.33, 0.66, 1.0)  # knots, of the largest speed
_FASTEST = 0.995  # of the samples: a smaller speed
_SHARES = (0.01, 0.2, 0.4, 0.6, 0.8, 0.99)  # knots: of the samples with a smaller current
_LATE = 0.006  # s between two past accelerations
_DELAYS = 8  # of these
_TONES = np.geomspace(0.7, 40.0, 40)  # Hz
_ORDERS = (1, 2, 3, 4, 5, 6, 8, 10, 12)  # per turn of a motor


@dataclass(frozen=True, eq=False)
class Motion:
    """How the refitted machine moved in one record, free of the sensors' noise; arrays (n,).

    driven: motor -> its current or torque; turned: motor -> its angle, rad
    """

    every: float
    t: Array
    angle: Array
    speed: Array
    acceleration: Array
    driven: Mapping[str, Array]
    turned: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Answers:
    """How every series answers a pulse of one N*m*s at a place, from `before` samples before it."""

    c: Confrontation
    of: Sequence[Array]
    before: Sequence[int]

    def to(self, torques: Mapping[str, Array], motions: Mapping[str, Motion]) -> list[Array]:
        """Columns per series (n, k) of torques (n, k) in every record."""
        from scipy.signal import fftconvolve

        found = []
        for s, answer, before in zip(self.c.series, self.of, self.before, strict=True):
            own, every = torques[s.record], motions[s.record].every
            columns = fftconvolve(own, answer[:, None], axes=0)
            found.append(every * columns[before : before + len(own)])
        return found


def courses(c: Confrontation, refit: Refit) -> Iterator[tuple[Kind, str, list[Array]]]:
    """(kind, place, columns per series) of all that is tried."""
    motions = {
        name: motion_of(c, refit, name) for name in dict.fromkeys(s.record for s in c.series)
    }
    for place in ("table", *c.core.motors):
        answers = answers_at(c, refit, place, motions)
        if answers is not None:
            for kind, torques in _torques(motions, place):
                yield kind, place, answers.to(torques, motions)
    for name in dict.fromkeys(s.name for s in c.series):
        yield "readings", name, _readings(c, refit, name)


def _torques(motions: Mapping[str, Motion], place: str) -> Iterator[tuple[Kind, dict[str, Array]]]:
    """(kind, torques (n, k) in each record); time and tones have strengths of their own in each."""

    def each(course: Callable[[Motion], Sequence[Array]]) -> dict[str, Array]:
        return {name: np.stack(course(m), axis=1) for name, m in motions.items()}

    def every(signal: Callable[[Motion], Array]) -> Array:
        return np.concatenate([signal(m) for m in motions.values()])

    angles, speeds = every(lambda m: m.angle), every(lambda m: np.abs(m.speed))
    along = np.linspace(angles.min(), angles.max(), _ALONG)
    fast = float(np.quantile(speeds, _FASTEST)) * np.array(_SPEEDS)
    yield "time", _apart(each(lambda m: _hats(m.t, np.linspace(m.t[0], m.t[-1], _IN_TIME))))
    yield "angle", each(lambda m: _hats(m.angle, along))
    yield "speed", each(lambda m: _hats(m.speed, fast))
    yield "acceleration", each(_past)
    for f in _TONES:
        yield "frequency", _apart(each(partial(_tone, f)))
    if all(place in m.driven for m in motions.values()):
        shares = np.unique(np.quantile(every(lambda m: m.driven[place]), _SHARES))
        yield "drive torque", each(lambda m: _hats(m.driven[place], shares))
    if all(place in m.turned for m in motions.values()):
        for n in _ORDERS:
            yield "turns", each(partial(_turning, n, place))


def _tone(frequency: float, m: Motion) -> list[Array]:
    return _waves(2.0 * np.pi * frequency * m.t)


def _turning(order: int, motor: str, m: Motion) -> list[Array]:
    return _waves(order * m.turned[motor])


def _waves(turned: Array) -> list[Array]:
    return [np.sin(turned), np.cos(turned)]


def _hats(x: Array, knots: Array) -> list[Array]:
    """Pieces of a curve over x, straight between its knots and constant outside."""
    return [np.interp(x, knots, one) for one in np.eye(len(knots))]


def _past(m: Motion) -> list[Array]:
    late = max(1, round(_LATE / m.every))
    n, a = len(m.t), m.acceleration
    return [
        np.concatenate([np.zeros(min(k * late, n)), a[: max(n - k * late, 0)]])
        for k in range(_DELAYS)
    ]


def _apart(torques: Mapping[str, Array]) -> dict[str, Array]:
    """The same with strengths of its own in each record, zero in all others."""
    found, first = {}, 0
    whole = sum(x.shape[1] for x in torques.values())
    for name, own in torques.items():
        found[name] = np.zeros((len(own), whole))
        found[name][:, first : first + own.shape[1]] = own
        first += own.shape[1]
    return found


def _readings(c: Confrontation, refit: Refit, name: str) -> list[Array]:
    """A channel that grows in time, or takes from the record's other channels."""
    simulated = [s.measured + left for s, left in zip(c.series, refit.left, strict=True)]
    names = list(dict.fromkeys(s.name for s in c.series))
    found = []
    for s, own in zip(c.series, simulated, strict=True):
        columns = np.zeros((len(s.t), len(names)))
        if s.name == name:
            there = {
                o.name: x for o, x in zip(c.series, simulated, strict=True) if o.record == s.record
            }
            for j, other in enumerate(names):
                x = own * (s.t - s.t[0]) / np.ptp(s.t) if other == name else there.get(other)
                columns[:, j] = 0.0 if x is None else x - np.mean(x)
        found.append(columns)
    return found


def motion_of(c: Confrontation, refit: Refit, record: str) -> Motion:
    """As simulated where it can be told: a sensor's noise in a course would explain itself."""
    from scipy.signal import savgol_filter

    own = {
        s.name: (s, s.measured + x)
        for s, x in zip(c.series, refit.left, strict=True)
        if s.record == record
    }
    [(s, _), *_] = own.values()
    k = next(k for k, other in enumerate(c.series) if other is s)
    recorded, every = c.columns(k), float(np.median(np.diff(s.t)))
    angle = np.asarray(recorded["theta_ref"], float)
    if "e" in own:
        angle = angle - own["e"][1]
    window = min(2 * round(_SMOOTH / every) + 5, len(s.t) - 1 + len(s.t) % 2)
    driven = {
        motor: x
        for motor in c.core.motors
        for name, (_, x) in own.items()
        if name in (f"I_{motor.rpartition('_')[2]}", f"T_{motor.rpartition('_')[2]}")
    }
    turned = {
        motor: np.asarray(recorded[name], float)
        for motor in c.core.motors
        if (name := f"theta_{motor.rpartition('_')[2]}") in recorded
    }
    return Motion(
        every,
        s.t,
        angle,
        savgol_filter(angle, window, 2, deriv=1, delta=every),
        savgol_filter(angle, window, 3, deriv=2, delta=every),
        driven,
        turned,
    )


def answers_at(
    c: Confrontation, refit: Refit, place: str, motions: Mapping[str, Motion]
) -> Answers | None:
    """Answers to a pulse at a place; None where the machine with it can't be simulated.

    One simulation has a pulse every so often. Where a flank changes under it a pulse tells of that,
    so that the middle answer of all that come while the machine moves counts.
    """
    height = _OF_TORQUE * c.sizes()["torque"] / ratio_to_table(c.core, place)
    if height <= 0.0:
        return None
    step = max([_WIDTH, *(_SAMPLES * m.every for m in motions.values())])
    longest = max(float(np.ptp(m.t)) for m in motions.values())
    knots = max(round(min(_BETWEEN, longest / _PULSES) / step), _KNOTS)
    core = refit.machine
    # a pulse at the knot in the middle, which reaches two knots to either side
    values = np.where(np.arange(knots) == knots // 2, height, 0.0)
    core.add_spline(place, [("t", 0.0, knots * step, knots, True)], list(values), height)
    there = c.left(core, refit.u)
    if there is None:
        return None
    of, before = [], []
    for s, with_it, without in zip(c.series, there, refit.left, strict=True):
        answer, first = _middle(motions[s.record], with_it - without, knots, step)
        of.append(answer / (height * step))
        before.append(first)
    return Answers(c, of, before)


def _middle(m: Motion, change: Array, knots: int, step: float) -> tuple[Array, int]:
    """Middle answer to the pulses while a record moves, and how many samples it begins early."""
    between = knots * step
    begin = knots // 2 * step
    begin += between * math.ceil((m.t[0] - begin) / between)
    pulses = np.arange(begin, m.t[-1], between)
    early, count = round(2 * step / m.every), round(between / m.every)
    first = np.rint((pulses - m.t[0]) / m.every).astype(np.intp) - early
    whole = (first >= 0) & (first + count <= len(m.t))
    speed = np.abs(np.interp(pulses, m.t, m.speed))
    moving = whole & (speed > _MOVING * np.max(speed, where=whole, initial=0.0))
    if not moving.any():
        return np.zeros(1), 0
    own = np.stack([change[k : k + count] for k in first[moving]])
    return np.median(own, axis=0), early
