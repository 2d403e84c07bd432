"""Commanded motions: an input signal, when it is over, and the words that made it.

Every motion can be written as one line, which the command line, files and pictures use:
``move:0.02,v=0.03,a=0.01,j=0.05,start=2``. Angles are the table's, in rad (m on a linear axis).
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike

from dualdrive import _core
from dualdrive.machine_file.frames import linear_unit
from dualdrive.units import UnitError, parse

if TYPE_CHECKING:
    from dualdrive.machine import Machine

__all__ = [
    "Motion",
    "MotionError",
    "cycle",
    "default_motion",
    "move",
    "multisine",
    "parse_motion",
    "sampled",
    "sine",
    "step",
]


class MotionError(ValueError):
    """A motion that can't be. The message is one line."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A commanded motion.

    waveform:   the signal theta_ref: value, rate, acceleration over time
    end:        when a simulation of it may stop: it has come to rest and had time to settle, s
    text:       the words that make it again by parse_motion; a description if it was sampled
    kind:       move, cycle, step, sine, multisine or sampled
    arguments:  what its builder was given
    """

    waveform: _core.Waveform
    end: float
    text: str
    kind: str
    arguments: Mapping[str, Any] = field(repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_again, (self.kind, dict(self.arguments)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Motion):
            return NotImplemented
        same = self.kind == other.kind and self.arguments.keys() == other.arguments.keys()
        return same and all(
            np.array_equal(value, other.arguments[name]) for name, value in self.arguments.items()
        )

    def __hash__(self) -> int:
        return hash((self.kind, self.text))


def _again(kind: str, arguments: dict[str, Any]) -> Motion:
    return _BUILDERS[kind](**arguments)


def _motion(
    kind: str, waveform: _core.Waveform, end: float, arguments: Mapping[str, Any], text: str = ""
) -> Motion:
    if not (math.isfinite(end) and end > 0):
        raise MotionError(f"{kind}: end = {end!r}: must be a time after 0; give end=")
    return Motion(waveform, end, text or _text(kind, arguments), kind, arguments)


def _text(kind: str, arguments: Mapping[str, Any]) -> str:
    """The shortest words that give the same motion."""
    defaults = inspect.signature(_BUILDERS[kind]).parameters
    words = []
    for name, value in arguments.items():
        if value is None or (name in defaults and value == defaults[name].default):
            continue
        word = ";".join(map(repr, value)) if isinstance(value, tuple) else repr(value)
        words.append(word if name == _FIRST[kind] else f"{name}={word}")
    return f"{kind}:{','.join(words)}"


def _floats(values: ArrayLike) -> tuple[float, ...]:
    return tuple(np.atleast_1d(np.asarray(values, float)).tolist())


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


def step(height: float, at: float = 0.0, settle: float = 10.0, end: float | None = None) -> Motion:
    """A jump of the commanded angle by `height` rad at `at`, s."""
    arguments = {"height": height, "at": at, "settle": settle, "end": end}
    return _motion("step", _core.step(height, at), at + settle if end is None else end, arguments)


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


def multisine(
    rms: float,
    f: float,
    lines: int = 10,
    seed: int = 0,
    start: float = 0.0,
    periods: float = 3.0,
    end: float | None = None,
) -> Motion:
    """Odd harmonics f, 3f, 5f, ... of equal size with random phases, starting from zero.

    rms in rad, base frequency f in Hz, `lines` harmonics. Raises ValueError.
    """
    arguments = {
        "rms": rms,
        "f": f,
        "lines": int(lines),
        "seed": int(seed),
        "start": start,
        "periods": periods,
        "end": end,
    }
    waveform = _core.odd_multisine(rms, f, int(lines), int(seed), start=start, from_zero=True)
    return _motion("multisine", waveform, start + periods / f if end is None else end, arguments)


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


_BUILDERS: Final[Mapping[str, Callable[..., Motion]]] = {
    "move": move,
    "cycle": cycle,
    "step": step,
    "sine": sine,
    "multisine": multisine,
    "sampled": sampled,
}
#: what stands first in the words, without its name
_FIRST: Final = {
    "move": "distance",
    "cycle": "targets",
    "step": "height",
    "sine": "amplitude",
    "multisine": "rms",
    "sampled": "t",
}
#: units of what can be said in words; "rad" ones are those of the table
_UNITS: Final = {
    "distance": "rad",
    "targets": "rad",
    "height": "rad",
    "amplitude": "rad",
    "rms": "rad",
    "v": "rad/s",
    "a": "rad/s^2",
    "j": "rad/s^3",
    "f": "Hz",
    "phase": "rad",
    "dwell": "s",
    "start": "s",
    "settle": "s",
    "at": "s",
    "end": "s",
    "periods": "",
    "repeats": "",
    "lines": "",
    "seed": "",
}
_WHOLE: Final = ("repeats", "lines", "seed")


def parse_motion(text: str, *, axis: str = "rotary") -> Motion:
    """Read a motion from its words: ``KIND:FIRST,name=value,...``.

    ``move:0.02,v=0.03,a=0.01,j=0.05,start=2``, ``cycle:0;10deg;0,v=2deg/s,a=1deg/s^2,dwell=2``,
    ``step:1mrad,at=3``, ``sine:1mrad,f=2``, ``multisine:20arcsec,f=0.5,lines=20``. Numbers may
    carry units. Raises MotionError naming word, value, rule and way out.
    """
    kind, _, rest = text.partition(":")
    kind = kind.strip()
    spoken = [name for name in _BUILDERS if name != "sampled"]
    if kind not in spoken:
        raise MotionError(
            f"motion {text!r}: {kind!r} is unknown; choose one of {', '.join(spoken)}"
        )
    known = inspect.signature(_BUILDERS[kind]).parameters
    arguments: dict[str, Any] = {}
    for position, word in enumerate(filter(None, (w.strip() for w in rest.split(",")))):
        name, given, value = (part.strip() for part in word.partition("="))
        if not given:
            name, value = _FIRST[kind], name
            if position:
                raise MotionError(f"motion {text!r}: {word!r}: write name=value after the first")
        if name not in known:
            ways = ", ".join(known)
            raise MotionError(f"motion {text!r}: {name!r} is unknown; a {kind} takes {ways}")
        if name in arguments:
            raise MotionError(f"motion {text!r}: {name} is given twice; leave one out")
        arguments[name] = _spoken(name, value, axis, text)
    missing = [n for n, p in known.items() if p.default is p.empty and n not in arguments]
    if missing:
        raise MotionError(f"motion {text!r}: {', '.join(missing)} missing; a {kind} needs it")
    try:
        return _BUILDERS[kind](**arguments)
    except MotionError:
        raise
    except ValueError as error:
        raise MotionError(f"motion {text!r}: {error}") from None


def _spoken(name: str, value: str, axis: str, text: str) -> Any:
    unit = _UNITS[name]
    if axis == "linear" and name != "phase":
        unit = {"rad/s^3": "m/s^3"}.get(unit, linear_unit(unit))
    try:
        if name == "targets":
            return tuple(parse(part, unit, key=name) for part in value.split(";"))
        if name == "j" and value == "inf":
            return math.inf
        number = parse(value, unit, key=name)
    except UnitError as error:
        raise MotionError(f"motion {text!r}: {error}") from None
    if name in _WHOLE and number != int(number):
        raise MotionError(f"motion {text!r}: {name} = {value}: must be a whole number")
    return int(number) if name in _WHOLE else number


def default_motion(machine: Machine) -> Motion:
    """A move that suits the machine: 60 % of its speed, and torque to spare.

    The time scale is that of the position loop, 1/K_v: ten of it to build up tension, fifteen to
    reach the speed limit. The heavy table moves 0.02 rad, as in the study of its hunting.
    """
    speed, acceleration = _limits(machine)
    core = machine.core
    controlled = core.controller_options["kind"] != "none"
    scale = 1.0 / core.get("controller.K_v") if controlled and core.get("controller.K_v") else 0.2
    v = _round(0.6 * speed if math.isfinite(speed) else 0.05 / scale * 0.2)
    a = _round(min(v / (15 * scale), 0.5 * acceleration))
    distance = _round(3.2 * v * scale)
    return move(
        distance, v, a, _round(a / scale), start=_round(10 * scale), settle=_round(25 * scale)
    )


def _limits(machine: Machine) -> tuple[float, float]:
    """The table's greatest speed and acceleration that the motors can give it."""
    core = machine.core
    speeds, torque, inertia = [math.inf], 0.0, core.get("table.J")
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        ratio = 1.0
        for part in (f"gearbox_{n}", f"mesh_{n}"):
            if part in core.connections:
                ratio *= core.get(f"{part}.ratio")
        speeds.append(core.get(f"{motor}.omega_max") / ratio)
        torque += core.get(f"{motor}.T_max") * ratio
        inertia += core.get(f"{motor}.J") * ratio**2
    return min(speeds), torque / inertia if inertia else math.inf


def _round(value: float) -> float:
    """One significant digit, or two where the first is a one: 0.0314 -> 0.03, 0.0106 -> 0.011."""
    digits = 2 if f"{value:e}"[0] == "1" else 1
    return float(f"{value:.{digits}g}")
