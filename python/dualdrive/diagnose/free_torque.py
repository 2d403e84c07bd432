"""What a torque of any course could still explain: no law is asked.

A short pulse of torque at the table and at each motor, put into the refitted machine where it moves
fastest, tells how its series answer; a torque of any course is a sum of such pulses. Courses that a
law could take are tried: in time, along the angle, over the speed, over the drive's own current or
torque, with the past acceleration (a mass or a foundation that gives), as a tone, a few times per
turn of a motor; and readings that grow in time or take from one another. Where the machine sticks
or a flank opens the answer is not the true one: a course may go unseen there, but none is seen
where there is none.

What noise a filter has coloured beyond what the whiteners know of makes every course gain: all are
divided by what the middle one gains more than noise would let it (Devlin and Roeder, Biometrics 55,
1999, 997-1004, do so with genes).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve, savgol_filter
from scipy.stats import chi2

from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.evidence import Evidence, effective
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.stage import scale_of
from dualdrive.replay import ratio_to_table

Array = NDArray[np.float64]

#: chance (log10, the looking paid for) below which a course is surely there
SURELY = -4.0
_PULSE, _LEAST = 0.004, 2.0  # s, and sampling intervals: half the width of a pulse
_OF_TORQUE = 0.2  # of the drives': its height
_BETWEEN, _PULSES, _KNOTS = 0.5, 8, 12  # s between two; in a record, at least; of a period
_MOVING = 0.2  # of the largest speed under a pulse: less tells of sticking
_SMOOTH = 0.012  # s: over which the table's speed and acceleration are read
_HOURS, _ALONG = 10, 12  # knots: of time in each record, of the angle's travel
_SPEEDS = (-1.0, -0.66, -0.33, -0.08, 0.08, 0.33, 0.66, 1.0)  # of the largest
_FASTEST = 0.995  # of the samples: a smaller speed
_SHARES = (0.01, 0.2, 0.4, 0.6, 0.8, 0.99)  # of the samples with a smaller current
_LATE, _DELAYS = 0.006, 8  # s between two past accelerations, and how many
_TONES = np.geomspace(0.7, 40.0, 40)  # Hz
_ORDERS = (1, 2, 3, 4, 5, 6, 8, 10, 12)  # per turn of a motor
_RAREST = -300.0  # log10: nothing smaller is a number


@dataclass(frozen=True)
class Course:
    """A torque, or an error of a reading, that a free curve explains.

    kind:    what it follows: ``time``, ``angle``, ``speed``, ``drive torque``, ``acceleration``,
        ``frequency``, ``turns``; of a reading ``readings``
    place:   body it acts on, or the channel
    gain:    fall of chi^2 over its inflation; numbers: of the curve
    chance:  log10 of how often noise alone would gain as much in any of the courses tried
    """

    kind: str
    place: str
    gain: float
    numbers: int
    chance: float


def strongest_course(seen: Evidence, refit: Refit) -> Course | None:
    """The least likely to be noise, of what a refit leaves; None where no pulse can be simulated.

    Only a closed loop has one: the floors of a torque balance are reckoned, not seen.
    """
    c = seen.confrontation
    if c.mode != "closed_loop":
        return None
    scorer, over = scale_of(seen, refit).scorer, effective(seen.white(refit.left), seen)
    tried = []
    for kind, place, columns in _courses(c, refit):
        gain, numbers = scorer(seen.white(columns)).gain / over, columns[0].shape[1]
        tried.append(Course(kind, place, gain, numbers, _log_chance(gain, numbers)))
    if not tried:
        return None
    middle = float(np.median([_as_one_number(x.chance) for x in tried]))
    colour = max(middle / float(chi2.median(1)), 1.0)
    best = min(tried, key=lambda x: x.chance)
    chance = best.chance / colour + math.log10(len(tried))
    return replace(best, chance=min(chance, 0.0))


def _log_chance(gain: float, numbers: int) -> float:
    """Log10 of how often noise gains as much with so many numbers."""
    return float(chi2.logsf(max(gain, 0.0), numbers)) / math.log(10.0)


def _as_one_number(log_chance: float) -> float:
    """The gain of a single number that is as rare."""
    return float(chi2.isf(10.0 ** max(log_chance, _RAREST), 1))


@dataclass(frozen=True, eq=False)
class _Motion:
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
class _Answers:
    """How every series answers a pulse of one N*m*s at a place, from `before` samples before it."""

    c: Confrontation
    of: Sequence[Array]
    before: Sequence[int]

    def to(self, torques: Mapping[str, Array], motions: Mapping[str, _Motion]) -> list[Array]:
        """Columns per series (n, k) of torques (n, k) in every record."""
        found = []
        for s, answer, before in zip(self.c.series, self.of, self.before, strict=True):
            own, every = torques[s.record], motions[s.record].every
            columns = fftconvolve(own, answer[:, None], axes=0)
            found.append(every * columns[before : before + len(own)])
        return found


def _courses(c: Confrontation, refit: Refit) -> Iterator[tuple[str, str, list[Array]]]:
    """(kind, place, columns per series) of all that is tried."""
    motions = {name: _motion(c, refit, name) for name in dict.fromkeys(s.record for s in c.series)}
    for place in ("table", *c.core.motors):
        answers = _answers(c, refit, place, motions)
        if answers is not None:
            for kind, torques in _torques(motions, place):
                yield kind, place, answers.to(torques, motions)
    for name in dict.fromkeys(s.name for s in c.series):
        yield "readings", name, _readings(c, refit, name)


def _torques(motions: Mapping[str, _Motion], place: str) -> Iterator[tuple[str, dict[str, Array]]]:
    """(kind, torques (n, k) in each record); time and tones have strengths of their own in each."""

    def each(course: Callable[[_Motion], Sequence[Array]]) -> dict[str, Array]:
        return {name: np.stack(course(m), axis=1) for name, m in motions.items()}

    def every(signal: Callable[[_Motion], Array]) -> Array:
        return np.concatenate([signal(m) for m in motions.values()])

    angles, speeds = every(lambda m: m.angle), every(lambda m: np.abs(m.speed))
    along = np.linspace(angles.min(), angles.max(), _ALONG)
    fast = float(np.quantile(speeds, _FASTEST)) * np.array(_SPEEDS)
    yield "time", _apart(each(lambda m: _hats(m.t, np.linspace(m.t[0], m.t[-1], _HOURS))))
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


def _tone(frequency: float, m: _Motion) -> list[Array]:
    return _waves(2.0 * np.pi * frequency * m.t)


def _turning(order: int, motor: str, m: _Motion) -> list[Array]:
    return _waves(order * m.turned[motor])


def _waves(turned: Array) -> list[Array]:
    return [np.sin(turned), np.cos(turned)]


def _hats(x: Array, knots: Array) -> list[Array]:
    """Pieces of a curve over x, straight between its knots and constant outside."""
    return [np.interp(x, knots, one) for one in np.eye(len(knots))]


def _past(m: _Motion) -> list[Array]:
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


def _motion(c: Confrontation, refit: Refit, record: str) -> _Motion:
    """As simulated where it can be told: a sensor's noise in a course would explain itself."""
    own = {
        s.name: (s, s.measured + x)
        for s, x in zip(c.series, refit.left, strict=True)
        if s.record == record
    }
    [(s, _), *_] = own.values()
    k = next(k for k, other in enumerate(c.series) if other is s)
    recorded, every = c.columns(k), float(np.median(np.diff(s.t)))
    angle = np.asarray(
        recorded["theta_ref"] if "theta_ref" in recorded else recorded["theta_m"], float
    )
    if "e" in own and "theta_ref" in recorded:
        angle = angle - own["e"][1]
    window = 2 * round(_SMOOTH / every) + 5
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
    return _Motion(
        every,
        s.t,
        angle,
        savgol_filter(angle, window, 2, deriv=1, delta=every),
        savgol_filter(angle, window, 3, deriv=2, delta=every),
        driven,
        turned,
    )


def _answers(
    c: Confrontation, refit: Refit, place: str, motions: Mapping[str, _Motion]
) -> _Answers | None:
    """Answers to a pulse at a place; None where the machine with it can't be simulated.

    One simulation has a pulse every so often. Where a flank changes under it a pulse tells of that,
    so that the middle answer of all that come while the machine moves counts.
    """
    height = _OF_TORQUE * c.sizes()["torque"] / ratio_to_table(c.core, place)
    if height <= 0.0:
        return None
    step = max([_PULSE, *(_LEAST * m.every for m in motions.values())])
    shortest = min(float(m.t[-1]) for m in motions.values())
    knots = max(round(min(_BETWEEN, shortest / _PULSES) / step), _KNOTS)
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
    return _Answers(c, of, before)


def _middle(m: _Motion, change: Array, knots: int, step: float) -> tuple[Array, int]:
    """Middle answer to the pulses while a record moves, and how many samples it begins early."""
    between = knots * step
    pulses = np.arange(knots // 2 * step, m.t[-1], between)
    early, count = round(2 * step / m.every), round(between / m.every)
    first = np.searchsorted(m.t, pulses) - early
    whole = (first >= 0) & (first + count <= len(m.t))
    speed = np.abs(np.interp(pulses, m.t, m.speed))
    moving = whole & (speed > _MOVING * np.max(speed, where=whole, initial=0.0))
    if not moving.any():
        return np.zeros(1), 0
    own = np.stack([change[k : k + count] for k in first[moving]])
    return np.median(own, axis=0), early
