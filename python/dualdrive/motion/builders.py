"""The kinds of motion and what each is made from. Angles are the table's, in rad (m)."""

from __future__ import annotations

import functools
import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, ParamSpec

import numpy as np
from numpy.typing import ArrayLike

from dualdrive import _core
from dualdrive.echo import InputError
from dualdrive.memory import excess

__all__ = [
    "BUILDERS",
    "FIRST",
    "Motion",
    "MotionError",
    "cycle",
    "move",
    "multisine",
    "sampled",
    "shuttle",
    "sine",
    "step",
]


#: bytes of a harmonic, and of a move with its seven phases, while they are put together
_LINE: Final = 100
_MOVE: Final = 1000


#: argument of the core -> what motions call it
_OWN: Final = {
    "speed": ("v", "speeds"),
    "acceleration": ("a",),
    "jerk": ("j",),
    "frequency_hz": ("f",),
    "base_frequency_hz": ("f",),
}
_OF_CORE: Final = re.compile(rf"\w+: ({'|'.join(_OWN)}) = (.*)", re.DOTALL)
P = ParamSpec("P")


class MotionError(InputError):
    """A motion that can't be. The message is one line."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A commanded motion.

    waveform:   the signal theta_ref: value, rate, acceleration over time
    end:        when a simulation of it may stop: it has come to rest and had time to settle, s
    text:       the words that make it again by parse_motion; a description if it was sampled
    kind:       move, cycle, shuttle, step, sine, multisine or sampled
    arguments:  what its builder was given
    """

    waveform: _core.Waveform
    end: float
    text: str
    kind: str
    arguments: Mapping[str, Any] = field(repr=False)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Motion):
            return NotImplemented
        same = self.kind == other.kind and self.arguments.keys() == other.arguments.keys()
        return same and all(
            np.array_equal(value, other.arguments[name]) for name, value in self.arguments.items()
        )

    def __hash__(self) -> int:
        return hash((self.kind, self.text))


def _refuse_excess(kind: str, name: str, count: int, size: int) -> None:
    if too_much := excess(float(count) * size):
        raise MotionError(f"{kind}: {name} = {count}: {too_much}; give a smaller number")


def _motion(
    kind: str, waveform: _core.Waveform, end: float, arguments: Mapping[str, Any], text: str = ""
) -> Motion:
    if not (math.isfinite(end) and end > 0):
        raise MotionError(f"{kind}: end = {end!r}: must be a time after 0; give end=")
    return Motion(waveform, end, text or _text(kind, arguments), kind, arguments)


def _text(kind: str, arguments: Mapping[str, Any]) -> str:
    """The shortest words that give the same motion."""
    defaults = inspect.signature(BUILDERS[kind]).parameters
    words = []
    for name, value in arguments.items():
        if value is None or (name in defaults and value == defaults[name].default):
            continue
        word = ";".join(map(repr, value)) if isinstance(value, tuple) else repr(value)
        words.append(word if name == FIRST[kind] else f"{name}={word}")
    return f"{kind}:{','.join(words)}"


def _in_its_words(build: Callable[P, Motion]) -> Callable[P, Motion]:
    """What the core refuses is told by the argument's own name: v, not speed."""

    @functools.wraps(build)
    def built(*args: P.args, **kwargs: P.kwargs) -> Motion:
        try:
            return build(*args, **kwargs)
        except ValueError as error:
            told = _OF_CORE.fullmatch(str(error))
            if told is None:
                raise
            own = inspect.signature(build).parameters
            name = next(name for name in _OWN[told[1]] if name in own)
            raise MotionError(f"{build.__name__}: {name} = {told[2]}") from None

    return built


def _floats(values: ArrayLike) -> tuple[float, ...]:
    return tuple(np.atleast_1d(np.asarray(values, float)).tolist())


@_in_its_words
def move(
    distance: float,
    v: float,
    a: float,
    j: float = math.inf,
    start: float = 0.0,
    settle: float = 5.0,
    end: float | None = None,
) -> Motion:
    """A jerk-limited move from rest to rest.

    distance in rad of either sign; limits v rad/s, a rad/s², j rad/s³ (inf: trapezoid of speed);
    begins at `start`, ends `settle` after it has arrived unless `end` is given, s.
    Raises ValueError naming argument, value and rule.
    """
    arguments = {
        "distance": distance,
        "v": v,
        "a": a,
        "j": j,
        "start": start,
        "settle": settle,
        "end": end,
    }
    waveform = _core.jerk_limited_move(distance, v, a, j, start=start)
    return _motion("move", waveform, waveform.end() + settle if end is None else end, arguments)


@_in_its_words
def cycle(
    targets: Sequence[float] | ArrayLike,
    v: float,
    a: float,
    j: float = math.inf,
    dwell: float = 1.0,
    start: float = 0.0,
    repeats: int = 1,
    end: float | None = None,
) -> Motion:
    """Moves to each target in turn with a dwell (s) after each, all `repeats` times.

    targets: angles in rad, shape (n,); limits and errors as for `move`.
    """
    places = _floats(targets)
    _refuse_excess("cycle", "repeats", int(repeats), _MOVE * len(places))
    arguments = {
        "targets": places,
        "v": v,
        "a": a,
        "j": j,
        "dwell": dwell,
        "start": start,
        "repeats": int(repeats),
        "end": end,
    }
    waveform = _core.cycle_of_moves(list(places), v, a, j, dwell, start, int(repeats))
    over = waveform.end() + dwell if end is None else end
    return _motion("cycle", waveform, over, arguments)


@_in_its_words
def shuttle(
    distance: float,
    speeds: Sequence[float] | ArrayLike,
    a: float,
    j: float = math.inf,
    dwell: float = 1.0,
    start: float = 0.0,
    end: float | None = None,
) -> Motion:
    """There and back once at each of several speeds, with a dwell (s) after each move.

    speeds: limits in rad/s, shape (n,); the others and errors as for `move`.
    """
    limits = _floats(speeds)
    arguments = {
        "distance": distance,
        "speeds": limits,
        "a": a,
        "j": j,
        "dwell": dwell,
        "start": start,
        "end": end,
    }
    moves, over = [], start
    for way, v in ((way, v) for v in limits for way in (distance, -distance)):
        moves.append(_core.jerk_limited_move(way, v, a, j, start=over))
        over = moves[-1].end() + dwell
    if not moves:
        raise MotionError("shuttle: speeds is empty; give at least one")
    return _motion("shuttle", _core.sum(moves), over if end is None else end, arguments)


@_in_its_words
def step(height: float, at: float = 0.0, settle: float = 10.0, end: float | None = None) -> Motion:
    """A jump of the commanded angle by `height` rad at `at`, s."""
    arguments = {"height": height, "at": at, "settle": settle, "end": end}
    return _motion("step", _core.step(height, at), at + settle if end is None else end, arguments)


@_in_its_words
def sine(
    amplitude: float,
    f: float,
    phase: float = 0.0,
    start: float = 0.0,
    periods: float = 10.0,
    end: float | None = None,
) -> Motion:
    """A sine of `amplitude` rad at `f` Hz from `start` on, for `periods`. Raises ValueError."""
    arguments = {
        "amplitude": amplitude,
        "f": f,
        "phase": phase,
        "start": start,
        "periods": periods,
        "end": end,
    }
    waveform = _core.sine(amplitude, f, phase, 0.0, start)
    return _motion("sine", waveform, start + periods / f if end is None else end, arguments)


@_in_its_words
def multisine(
    rms: float,
    f: float,
    lines: int = 10,
    seed: int = 0,
    start: float = 0.0,
    periods: float = 3.0,
    levels: Sequence[float] | ArrayLike = (1.0,),
    end: float | None = None,
) -> Motion:
    """Odd harmonics f, 3f, 5f, ... of equal size with random phases, starting from zero.

    rms in rad, base frequency f in Hz, `lines` harmonics; `periods` of it at each of the `levels`,
    which are factors on `rms`. With several levels the periods must be whole, so that the size
    changes where the signal is zero. Raises ValueError.
    """
    factors = _floats(levels)
    arguments = {
        "rms": rms,
        "f": f,
        "lines": int(lines),
        "seed": int(seed),
        "start": start,
        "periods": periods,
        "levels": factors,
        "end": end,
    }
    _refuse_excess("multisine", "lines", int(lines), _LINE * len(factors))
    if not factors or (len(factors) > 1 and periods != int(periods)):
        rule = "several levels need whole periods" if factors else "give at least one"
        raise MotionError(f"multisine: levels = {factors}, periods = {periods:g}: {rule}")
    steps = np.diff((0.0, *factors)).tolist()
    lasts = periods / f
    waveform = _core.sum(
        [
            factor
            * _core.odd_multisine(
                rms, f, int(lines), int(seed), start=start + k * lasts, from_zero=True
            )
            for k, factor in enumerate(steps)
        ]
    )
    over = start + len(factors) * lasts if end is None else end
    return _motion("multisine", waveform, over, arguments)


@_in_its_words
def sampled(t: ArrayLike, values: ArrayLike, interpolation: str = "cubic") -> Motion:
    """A recorded motion: `values` (rad) at times `t` (s), shapes (n,), n >= 2.

    interpolation: hold, linear or cubic. Raises ValueError naming argument, index and rule.
    """
    kinds = {kind.name: kind for kind in _core.Interpolation}
    if interpolation not in kinds:
        ways = ", ".join(kinds)
        raise MotionError(f"sampled: interpolation = {interpolation!r}: choose one of {ways}")
    times, points = np.array(t, float), np.array(values, float)
    waveform = _core.sampled(times, points, kinds[interpolation])
    arguments = {"t": times, "values": points, "interpolation": interpolation}
    text = f"sampled: {times.size} points from {times[0]:g} s to {times[-1]:g} s"
    return _motion("sampled", waveform, float(times[-1]), arguments, text)


#: kind -> what builds it
BUILDERS: Final[Mapping[str, Callable[..., Motion]]] = {
    "move": move,
    "cycle": cycle,
    "shuttle": shuttle,
    "step": step,
    "sine": sine,
    "multisine": multisine,
    "sampled": sampled,
}
#: what stands first in the words, without its name
FIRST: Final = {
    "move": "distance",
    "cycle": "targets",
    "shuttle": "distance",
    "step": "height",
    "sine": "amplitude",
    "multisine": "rms",
    "sampled": "t",
}
