"""Motions in words: ``move:0.02,v=0.03,a=0.01,j=0.05,start=2``, units welcome."""

from __future__ import annotations

import inspect
import math
from typing import Any, Final

from dualdrive.machine_file.frames import linear_unit
from dualdrive.units import UnitError, parse

from .builders import BUILDERS, FIRST, Motion, MotionError

__all__ = ["parse_motion"]

#: units of what can be said in words; "rad" ones are those of the table
_UNITS: Final = {
    "distance": "rad",
    "targets": "rad",
    "height": "rad",
    "amplitude": "rad",
    "rms": "rad",
    "v": "rad/s",
    "speeds": "rad/s",
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
    "levels": "",
    "repeats": "",
    "lines": "",
    "seed": "",
}
_LISTS: Final = ("targets", "speeds", "levels")
_WHOLE: Final = ("repeats", "lines", "seed")


def parse_motion(text: str, *, axis: str = "rotary") -> Motion:
    """Read a motion from its words: ``KIND:FIRST,name=value,...``.

    ``move:0.02,v=0.03,a=0.01,j=0.05,start=2``, ``cycle:0;10deg;0,v=2deg/s,a=1deg/s^2,dwell=2``,
    ``shuttle:1deg,speeds=1deg/s;2deg/s,a=1deg/s^2``, ``step:1mrad,at=3``, ``sine:1mrad,f=2``,
    ``multisine:20arcsec,f=0.5,lines=20,levels=1;3``. Numbers may carry units. Raises MotionError
    naming word, value, rule and way out.
    """
    kind, _, rest = text.partition(":")
    kind = kind.strip()
    spoken = [name for name in BUILDERS if name != "sampled"]
    if kind not in spoken:
        raise MotionError(
            f"motion {text!r}: {kind!r} is unknown; choose one of {', '.join(spoken)}"
        )
    known = inspect.signature(BUILDERS[kind]).parameters
    arguments: dict[str, Any] = {}
    for position, word in enumerate(filter(None, (w.strip() for w in rest.split(",")))):
        name, given, value = (part.strip() for part in word.partition("="))
        if not given:
            name, value = FIRST[kind], name
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
        them = "them" if len(missing) > 1 else "it"
        raise MotionError(f"motion {text!r}: {', '.join(missing)} missing; a {kind} needs {them}")
    try:
        return BUILDERS[kind](**arguments)
    except ValueError as error:
        raise MotionError(f"motion {text!r}: {error}") from None


def _spoken(name: str, value: str, axis: str, text: str) -> Any:
    unit = _UNITS[name]
    if axis == "linear" and name != "phase":
        unit = {"rad/s^3": "m/s^3"}.get(unit, linear_unit(unit))
    try:
        if name in _LISTS:
            return tuple(parse(part, unit, key=name) for part in value.split(";"))
        if name == "j" and value == "inf":
            return math.inf
        number = parse(value, unit, key=name)
    except UnitError as error:
        raise MotionError(f"motion {text!r}: {error}") from None
    if name in _WHOLE and number != int(number):
        raise MotionError(f"motion {text!r}: {name} = {value}: must be a whole number, such as 2")
    return int(number) if name in _WHOLE else number
