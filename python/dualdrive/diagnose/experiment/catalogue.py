"""The menu: motions that bring out what quiet operation hides, in words of ``--motion``.

Which of them parts two explanations depends on the machine, so that all are scaled to it and tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from dualdrive.diagnose.experiment.limits import Axis

#: experiments that no motion of a running axis makes, and why one would still do them
LEFT_OUT: Mapping[str, str] = {
    "table locked, torque ramped": "clamp the table: torque over twist then shows stiffness and "
    "play without inertia and bearing friction; needs a clamp, so it is not planned here",
    "cold and warm": "repeat the record cold and after an hour of running: resistance, torque "
    "constant and grease change with temperature, geometry does not; a motion alone can't show it",
}


@dataclass(frozen=True)
class Item:
    """One experiment of the menu.

    motion:   words of ``--motion`` at a size: 1 is as planned, less is gentler
    settings: machine parameters to set for it
    """

    name: str
    why: str
    motion: Callable[[float], str]
    settings: Mapping[str, float] = field(default_factory=dict)


def menu(axis: Axis, seconds: float) -> list[Item]:
    """Every experiment that suits the axis and lasts about `seconds` at most, simplest first."""
    plain = list(_motions(axis, seconds))
    return [item for motion in plain for item in _with_tensions(motion, axis)]


def _with_tensions(item: Item, axis: Axis) -> Iterator[Item]:
    """The same as the drives are set, with more tension, one motor at work, and without tension.

    The last is the hardest to refit: a drive that is loose in its play goes where chance takes it.
    """
    yield item
    if axis.tension is None:
        return
    present, most = axis.tension
    tight = _round(min(max(2 * present, 0.3 * most), most))
    if tight > 1.2 * present:
        braced = "; more tension changes what grows with load, and nothing else"
        more = {"controller.T_ten": tight}
        yield Item(f"{item.name}, more tension", item.why + braced, item.motion, more)
    alone = {"controller.T_ten": 0.0, "controller.w": 1.0}
    text = "; with one motor at work its losses are told from the other's and from the table's"
    yield Item(f"{item.name}, one motor at work", item.why + text, item.motion, alone)
    free = "; without tension the flanks open and no preload hides friction"
    if present > 0:
        slack = {"controller.T_ten": 0.0}
        yield Item(f"{item.name}, no tension", item.why + free, item.motion, slack)


def _motions(axis: Axis, seconds: float) -> Iterator[Item]:
    start = _round(5 * axis.time)
    left = seconds - start
    yield Item(
        "slow two-way ramps",
        "at creep what depends on speed falls away and what depends on direction or place stays",
        _ramps(axis, 0.02, left, start),
    )
    yield Item(
        "slower two-way ramps",
        "speeds below the usual ones show friction that falls with speed, and a late sensor less",
        _ramps(axis, 0.003, left, start),
    )
    yield Item(
        "micro-reversals",
        "many small reversals show play, presliding and the step of dry friction",
        _reversals(axis, left, start),
    )
    yield Item(
        "travel at three speeds, both ways",
        "the same places at other speeds: what belongs to a place stays, what belongs to speed "
        "moves, and orders of angle and time part",
        _speeds(axis, left, start),
    )
    yield Item(
        "quick moves, both ways",
        "strong acceleration loads flanks and motors and brings out inertia, compliance, delays",
        _quick(axis, left, start),
    )
    yield Item(
        "odd multisine at two amplitudes",
        "a linear cause answers in proportion, a nonlinear one does not",
        _multisine(axis, left, start),
    )


def _ramps(axis: Axis, share: float, seconds: float, start: float) -> Callable[[float], str]:
    """There and back twice at a share of the greatest speed."""

    def words(size: float) -> str:
        v = _round(share * axis.speed)
        distance = _round(min(0.2 * seconds * v, axis.travel, max(axis.turns, default=math.inf)))
        a = _round(min(size * axis.acceleration, v / axis.time))
        repeats = max(1, min(2, int(seconds / (2 * (distance / v + 1)))))
        rest = f"j={_jerk(a, axis)},dwell=1,start={start:g},repeats={repeats}"
        return f"cycle:{distance:g};0,v={v:g},a={a:g},{rest}"

    return words


def _reversals(axis: Axis, seconds: float, start: float) -> Callable[[float], str]:
    def words(size: float) -> str:
        short = axis.turns[-1] / 20 if axis.turns else 0.02 * axis.speed * axis.time
        distance = _round(min(max(4 * axis.play, 0.2 * short), axis.travel))
        v = _round(size * min(0.1 * axis.speed, distance / axis.time))
        a = _round(min(size * axis.acceleration, v / axis.time))
        one = 2 * (distance / v + v / a + 2 * a / float(_jerk(a, axis)) + 0.5)
        repeats = max(1, min(20, int(seconds / one)))
        rest = f"j={_jerk(a, axis)},dwell=0.5,start={start:g},repeats={repeats}"
        return f"cycle:{distance:g};0,v={v:g},a={a:g},{rest}"

    return words


def _speeds(axis: Axis, seconds: float, start: float) -> Callable[[float], str]:
    def words(size: float) -> str:
        a = _round(size * axis.acceleration)
        fastest = min(size * axis.speed, a * seconds / 20)
        speeds = [_round(share * fastest) for share in (0.9, 0.3, 0.1)]
        moving = max(seconds - 6 * (1 + fastest / a + axis.time), 0.3 * seconds)
        room = moving / sum(2 / v for v in speeds)
        distance = _round(min(room, axis.travel, max(axis.turns, default=math.inf)))
        listed = ";".join(f"{v:g}" for v in speeds)
        return f"shuttle:{distance:g},speeds={listed},a={a:g},j={_jerk(a, axis)},start={start:g}"

    return words


def _quick(axis: Axis, seconds: float, start: float) -> Callable[[float], str]:
    def words(size: float) -> str:
        a = _round(size * axis.acceleration)
        v = _round(min(0.9 * size * axis.speed, a * seconds / 12))
        distance = _round(min(1.5 * v * max(v / a, axis.time), axis.travel))
        one = 2 * (distance / v + v / a + 2 * a / float(_jerk(a, axis)) + 1)
        repeats = max(1, min(6, int(seconds / one)))
        rest = f"j={_jerk(a, axis)},start={start:g},repeats={repeats}"
        return f"cycle:{distance:g};0,v={v:g},a={a:g},{rest}"

    return words


def _multisine(axis: Axis, seconds: float, start: float) -> Callable[[float], str]:
    """Two whole periods at each of two amplitudes, lines up to the position loop's bandwidth."""

    def words(size: float) -> str:
        f = _round(4 / seconds)
        lines = max(3, min(30, round(0.5 / axis.time / (2 * math.pi) / (2 * f)) + 1))
        top = 2 * math.pi * f * (2 * lines - 1)
        # flat lines up to `top` have rates of about rms * top / sqrt(3), peaks of three times that
        rms = _round(0.3 * size * min(axis.speed / (2 * top), axis.acceleration / top**2))
        rest = f"lines={lines},start={start:g},periods=2,levels=0.3;1"
        return f"multisine:{rms:g},f={f:g},{rest}"

    return words


def _jerk(a: float, axis: Axis) -> str:
    return f"{_round(a / axis.time):g}"


def _round(value: float) -> float:
    """Two significant digits: what a person types."""
    return float(f"{value:.2g}")
