"""Numbers with units: read what people write, hold SI, print what people read.

Every quantity of the core declares its unit as a string ("N*m", "rad", "kg*m^2", "1/s", "").
Text such as ``20arcsec``, ``1.1mrad``, ``1.5 kN*m`` or ``60%`` is converted to that unit and
refused where it cannot mean it. A number without a unit is SI already.

Angles are the trap. SI lets a radian count as one, so dimensions alone would take ``5 rpm`` for a
gain in 1/s and ``100 Hz`` for 100 rad/s. Here a unit that counts turns or degrees is accepted only
where the declared unit has an angle in the same place; a plain radian may be written or left out.
"""

from __future__ import annotations

import math
import re
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from dualdrive.echo import InputError, shown
from dualdrive.memory import excess

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "Conversion",
    "UnitError",
    "coherent",
    "conversion",
    "human",
    "is_unit",
    "parse",
    "parse_values",
]


class UnitError(InputError):
    """A value or unit that cannot be what it is used for. The message is one line."""


class Conversion(NamedTuple):
    """``si = scale * value + offset``; the offset is zero for all but temperatures."""

    scale: float
    offset: float


_NUMBER: Final = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_QUANTITY: Final = re.compile(rf"\s*({_NUMBER})\s*(.*?)\s*", re.DOTALL)

# What an engineer would write instead, for the end of an error message.
_EXAMPLES: Final = {
    "rad": "20arcsec or 1.1mrad",
    "rad/s": "1500rpm or 2.5deg/s",
    "N*m": "1.5kN*m",
    "N*m/rad": "20MN*m/rad or 12kN*m/arcmin",
    "kg*m^2": "0.045kg*m^2",
    "1/s": "5/s",
    "s": "100ms",
    "A": "8.66A",
    "V": "400V",
    "ohm": "150mohm",
    "H": "3mH",
    "m": "25um",
    "": "0.6 or 60%",
}

# Spellings from drawings, drives and catalogues that the unit library does not know.
_SPELLINGS: Final = (
    (re.compile(r"[·⋅∙×]"), "*"),
    (re.compile(r"[″]|''"), "arcsec"),
    (re.compile(r"[′]"), "arcmin"),
    (re.compile(r"⁻¹"), "^-1"),
    (re.compile(r"⁻²"), "^-2"),
    (re.compile(r"\b(U/min|Upm|r/min|rev/min)\b"), "rpm"),
    (re.compile(r"\b(s|min)-1\b"), r"\1^-1"),
    (re.compile(r"\bdps\b"), "deg/s"),
    (re.compile(r"\brev\b|\bU\b"), "turn"),
    (re.compile(r"\bOhm\b"), "ohm"),
    (re.compile(r"\bVs\b"), "V*s"),
    (re.compile(r"^/"), "1/"),
    (re.compile(r"\b([mkM]?)N([mcµu]?)m(s?)(²?)(?=$|[*/^ ])"), r"\1N*\2m\4*\3"),
    (re.compile(r"\b(k?g)([cm]?)m(\^2|²|2)"), r"\1*\2m^2"),
    (re.compile(r"\*(?=$|[*/ ])"), ""),
)

_FOREIGN: Final = re.compile(r"[0-9⁰¹²³⁴-⁹]{2,}|[0-9]\.|[^\w/*^°µμΩ%() .+-]")
_POWER: Final = re.compile(r"\^|\*\*")
_EXPONENT: Final = re.compile(r"\s*(?:[+-]?\.?([0-9])(?![0-9.])|\([+-]?([0-9])\))\s*")
_LONGEST: Final = 100  # characters; the longest of a catalogue has some twenty
_BYTES_OF_ONE: Final = 64.0  # of a range: in an array, and as a number of a list
_HIGHEST: Final = 100  # product of all exponents; N*m*s^2/rad^2 has 4

# Units that count an angle with something other than the radian.
_TURNING: Final = re.compile(r"(degree|arcminute|arcsecond|turn|grade|gradian)$")
_TURNING_RATE: Final = re.compile(r"revolutions_per_(minute|second|hour)$")
# The coherent units that a product is written in, in the order in which they are written.
_COHERENT: Final = (
    *("kg", "N", "J", "W", "Pa", "V", "ohm", "F", "H", "C", "Wb", "T", "A"),
    *("m", "s", "Hz", "K", "rad"),
)
#: (unit, SI unit) -> scale of what is met every day: the library that knows every unit takes half a
#: second to load, which a page or a table of angles would wait for
_EVERYDAY: Final = {
    ("arcsec", "rad"): math.pi / 648000,
    ("mrad", "rad"): 1e-3,
    ("deg", "rad"): math.pi / 180,
    ("mrad/s", "rad/s"): 1e-3,
    ("deg/s", "rad/s"): math.pi / 180,
    ("um", "m"): 1e-6,
    ("mm", "m"): 1e-3,
    ("mm/s", "m/s"): 1e-3,
    ("mN*m", "N*m"): 1e-3,
    ("kN*m", "N*m"): 1e3,
    ("MN*m", "N*m"): 1e6,
    ("kN", "N"): 1e3,
    ("ms", "s"): 1e-3,
}
_PREFIXES: Final = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))


@cache
def _registry() -> Any:
    """The unit library, loaded when the first unit is met: most runs never meet one."""
    import pint

    return pint.UnitRegistry(on_redefinition="ignore")


def _spell(unit: str) -> str:
    text = unit.strip()
    for pattern, replacement in _SPELLINGS:
        text = pattern.sub(replacement, text)
    return text


@lru_cache(maxsize=512)
def _parsed(unit: str) -> Any:
    """The library's unit for a text, or UnitError when it is none."""
    text = _spell(unit) if len(unit) <= _LONGEST else ""
    if text in ("%", "percent"):
        return _registry().Unit("percent")
    if len(unit) > _LONGEST or _FOREIGN.search(text) or _is_tower(text):
        raise UnitError(f"{shown(unit)} is not a unit")
    try:
        return _registry().parse_units(text, as_delta=False)
    except Exception as error:  # the library raises many kinds, some not its own
        raise UnitError(f"{unit!r} is not a unit") from error


def _is_tower(text: str) -> bool:
    """Whether a power is more than one digit, or powers pile up: kg^9^9^9^9 would be computed."""
    _, *rest = _POWER.split(text)
    exponents = [_EXPONENT.match(part) for part in rest]
    if not all(exponents) or any(e and e[0] == e.string for e in exponents[:-1]):
        return True
    return math.prod(max(1, int(e[1] or e[2])) for e in exponents if e) > _HIGHEST


def is_unit(text: str) -> bool:
    """Tell whether `text` can be read as a unit ("rpm", "N*m", "°/s", "" is one too)."""
    try:
        _parsed(text)
    except UnitError:
        return False
    return True


def _angle(unit: Any) -> tuple[float, bool]:
    """Power of angle in a unit, and whether anything but the radian counts it."""
    power, turning = 0.0, False
    for name, exponent in unit._units.items():
        if name.endswith("radian"):
            power += exponent
        elif _TURNING.search(name) or _TURNING_RATE.search(name):
            power, turning = power + exponent, True
    return power, turning


def _is_cycles(unit: Any) -> bool:
    return any(name.endswith("hertz") for name in unit._units)


def _example(declared: str) -> str:
    return f"write {declared or 'a plain number'}, e.g. {_EXAMPLES.get(declared, '1' + declared)}"


@lru_cache(maxsize=512)
def conversion(given: str, declared: str) -> Conversion:
    """Conversion from the unit `given` to the SI unit `declared`.

    Raises UnitError when one is not a unit or the two do not measure the same thing.
    """
    if given == declared:
        return Conversion(1.0, 0.0)
    if (given, declared) in _EVERYDAY:
        return Conversion(_EVERYDAY[given, declared], 0.0)
    to, unit = _parsed(declared), _parsed(given)
    (angle_to, _), (angle, turning) = _angle(to), _angle(unit)
    if angle_to == 1 and angle == 0 and dict(unit._units) == {"minute": -1}:
        return conversion("rpm", declared)  # drives write 1/min for turns per minute
    if unit.dimensionality != to.dimensionality:
        raise UnitError(f"{given or 'a plain number'} does not measure {declared or 'a ratio'}")
    if _is_cycles(unit) and not _is_cycles(to):
        raise UnitError(f"{given} may mean 1/s or turns per second here")
    if turning and angle != angle_to:
        raise UnitError(f"{given} counts an angle that {declared or 'a ratio'} does not")
    quantity = _registry().Quantity
    try:
        zero = float(quantity(0.0, unit).to(to).magnitude)
        one = float(quantity(1.0, unit).to(to).magnitude)
    except TypeError as error:  # the library's, for a scale with its own zero inside a product
        raise UnitError(f"{given}: a temperature on a scale with its own zero; write K") from error
    except (ArithmeticError, ValueError):  # of a size beyond all numbers, or a logarithm
        raise UnitError(f"{given} can't be converted to {declared or 'a ratio'}") from None
    return Conversion(one - zero, zero)


@lru_cache(maxsize=512)
def coherent(given: str) -> str:
    """The SI unit without prefix for what `given` measures: ``m/s`` for mm/s, ``N*m`` for kNm.

    Formulas compute in such units alone. Raises UnitError when `given` is no unit, or may count
    turns or not.
    """
    unit = _parsed(given)
    if dict(unit._units) == {"minute": -1}:
        raise UnitError(f"{given} may mean 1/s or turns per minute here; write 1/s or rpm")
    powers: dict[str, float] = {}
    for name, exponent in unit._units.items():
        for symbol, own in _coherent_factors(name).items():
            powers[symbol] = powers.get(symbol, 0.0) + own * exponent
    above = [_power(s, powers[s]) for s in _COHERENT if powers.get(s, 0.0) > 0]
    below = [_power(s, -powers[s]) for s in _COHERENT if powers.get(s, 0.0) < 0]
    return "/".join(["*".join(above) or "1", *below]) if above or below else ""


def _coherent_factors(name: str) -> dict[str, float]:
    """One unit of the library as powers of coherent ones: ``{"rad": 1, "s": -1}`` for rpm."""
    unit = _registry().Unit(name)
    if _TURNING_RATE.search(name):
        return {"rad": 1.0, "s": -1.0}
    for symbol in _COHERENT:
        own = _parsed(symbol)
        alike = _angle(own)[0] == _angle(unit)[0] and _is_cycles(own) == _is_cycles(unit)
        if alike and own.dimensionality == unit.dimensionality:
            return {symbol: 1.0}
    base = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[current]": "A", "[temperature]": "K"}
    dimensions = dict(unit.dimensionality)
    if not dimensions.keys() <= base.keys():
        raise UnitError(f"{name} is not measured in SI units")
    return {base[dimension]: float(power) for dimension, power in dimensions.items()}


def _power(symbol: str, exponent: float) -> str:
    return symbol if exponent == 1 else f"{symbol}^{exponent:g}"


def parse(
    value: str | float,
    unit: str = "",
    *,
    key: str = "value",
    reference: float | None = None,
) -> float:
    """Return `value` in the declared SI `unit`.

    value:      a number (SI already) or text such as ``20arcsec``, ``1.5 kN*m``, ``60%``
    key:        how the value is called in an error
    reference:  SI value that 100 % stands for (a rated torque, say); without it a percentage is
                accepted only for a plain ratio

    Raises UnitError naming key, value, rule and way out.
    """
    if isinstance(value, bool):
        raise UnitError(f"{key} = {value}: must be a number; {_example(unit)}")
    if not isinstance(value, str):
        return _finite(_plain_number(value, unit, key), value, unit, key)
    match = _QUANTITY.fullmatch(value.replace("−", "-"))
    if match is None or match[2].startswith(","):
        hint = "; the decimal sign is a point" if "," in value else ""
        raise UnitError(f"{key} = {shown(value)}: not a number with a unit{hint}; {_example(unit)}")
    number, given = float(match[1]), match[2]
    if not given:
        return _finite(number, value, unit, key)
    if given in ("%", "percent"):
        return _finite(_percent(number, value, unit, key, reference), value, unit, key)
    try:
        scale, offset = conversion(given, unit)
    except UnitError as error:
        raise UnitError(f"{key} = {shown(value)}: {error}; {_example(unit)}") from None
    if offset:
        rule = "a temperature on a scale with its own zero is ambiguous"
        raise UnitError(f"{key} = {shown(value)}: {rule}; {_example(unit)}")
    return _finite(number * scale, value, unit, key)


def _plain_number(value: object, unit: str, key: str) -> float:
    try:
        return float(value)  # type: ignore[arg-type]  # whatever a file or a caller has there
    except (TypeError, ValueError):
        rule = "must be a number or text with a unit"
    except OverflowError:
        rule = "must be finite"
    raise UnitError(f"{key} = {shown(value)}: {rule}; {_example(unit)}")


def _percent(number: float, value: str, unit: str, key: str, reference: float | None) -> float:
    if reference is None and unit:
        rule = "no rated value that a percentage could refer to"
        raise UnitError(f"{key} = {shown(value)}: {rule}; {_example(unit)}")
    return number / 100.0 * (1.0 if reference is None else reference)


def _finite(number: float, value: str | float, unit: str, key: str) -> float:
    if not math.isfinite(number):
        raise UnitError(f"{key} = {shown(value)}: must be finite; {_example(unit)}")
    return number


def parse_values(
    text: str | float,
    unit: str = "",
    *,
    key: str = "value",
    reference: float | None = None,
) -> NDArray[np.float64]:
    """Return the values that ``start:stop:count`` (ends included) or ``a,b,c`` name, in SI.

    ``0:1e-3:20`` is 20 values from 0 to 1e-3; every number may carry a unit: ``0:22arcsec:5``,
    ``10%,50%,1.2kN*m``. A single value gives an array of one. Shape (count,).

    Raises UnitError naming key, text, rule and way out.
    """
    import numpy as np

    def one(part: str) -> float:
        return parse(part, unit, key=key, reference=reference)

    if not isinstance(text, str):
        return np.array([parse(text, unit, key=key)])
    if ":" not in text:
        parts = text.split(",")
        if not all(part.strip() for part in parts):
            raise UnitError(f"{key} = {shown(text)}: an empty value in the list; write a,b,c")
        return np.array([one(part) for part in parts])
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 3 or not re.fullmatch(r"[0-9]{1,18}", parts[2]) or int(parts[2]) < 1:
        rule = "a range is start:stop:count with a whole count of at least 1"
        raise UnitError(f"{key} = {shown(text)}: {rule}; write e.g. 0:1e-3:20")
    start, stop, count = one(parts[0]), one(parts[1]), int(parts[2])
    if too_much := excess(_BYTES_OF_ONE * count):
        rule = f"a range of {count} values {too_much}"
        raise UnitError(f"{key} = {shown(text)}: {rule}; give a smaller count")
    if count == 1 and start != stop:
        rule = "one point cannot include both ends"
        raise UnitError(f"{key} = {shown(text)}: {rule}; give a count of 2 or more, or one value")
    return np.linspace(start, stop, count)


def human(
    value: float,
    unit: str = "",
    *,
    digits: int = 4,
    prefer: str | None = None,
    like: float | None = None,
) -> str:
    """Return a short text for an SI value: ``22.69 arcsec``, ``1.1 mrad``, ``1.5 kN·m``.

    Angles below 1 mrad are given in arc seconds, other units get the prefix that leaves one to
    three digits before the point. `prefer` names the unit to use instead ("rpm", "arcmin"), `like`
    is an SI value that is to have the same unit. What comes out can be read back by `parse`.
    """
    if prefer is not None:
        scale, offset = conversion(prefer, unit)
        return _join((value - offset) / scale, prefer, digits)
    size = abs(value if like is None else like)
    if not math.isfinite(size) or size == 0 or unit.startswith(("kg", "1/", "K")) or not unit:
        return _join(value, unit, digits)
    if unit == "rad" and size < 1e-3:
        return _join(value / (math.pi / 648000), "arcsec", digits)
    ceiling = 1.0 if re.match(r"(rad|s)(?!\w)", unit) else 1e9  # no kiloseconds
    rounded = float(f"{size:.{digits}g}")
    fitting = (p for p in _PREFIXES if p[0] <= ceiling and rounded >= p[0])
    factor, prefix = next(fitting, _PREFIXES[-1])
    return _join(value / factor, prefix + unit, digits)


def _join(number: float, unit: str, digits: int) -> str:
    pretty = unit.replace("*", "·").replace("^2", "²").replace("ohm", "Ω")
    return f"{number:.{digits}g} {pretty}".rstrip()
