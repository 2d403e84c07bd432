"""Laws that users write without a compiler: the formula of an expression, the curve of a spline."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from itertools import chain
from typing import Any, Final

from dualdrive import _core
from dualdrive.echo import shown
from dualdrive.memory import excess
from dualdrive.units import UnitError, coherent, parse

from .frames import unit_on_axis
from .layers import MachineError, expect
from .trains import Structure

__all__ = ["LAW_KEYS", "OWN_KEYS", "USER_LAWS", "add_user_law", "curve_entry"]

_COLUMNS: Final = "{ name = 'unit' } of each recorded column that the law reads"
#: what an entry takes besides effect and place, in words
LAW_KEYS: Final[dict[str, dict[str, str]]] = {
    "expression": {
        "formula": "a torque: '-c*speed*abs(speed)'",
        "parameters": "{ name = number or text with a unit } of each number of its own",
        "columns": _COLUMNS,
    },
    "spline": {
        "coordinate": "t, angle, speed, a signal or a recorded column; two for a surface",
        "low": "of the first knot, one for each coordinate",
        "high": "of the last knot, one for each coordinate",
        "values": "torques at the knots; of a surface a list for each knot of the first coordinate",
        "knots": "in place of values: how many, all zero",
        "periodic": "whether high is low again; false unless given",
        "size": "usual size of a value, 300 N*m unless given",
        "columns": _COLUMNS,
    },
}
#: the keys of an entry that say what the law is; all others are numbers of it
OWN_KEYS: Final = {law: set(keys) for law, keys in LAW_KEYS.items()}
USER_LAWS: Final = tuple(OWN_KEYS)
_NUMBER: Final = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_BYTES_OF_ONE: Final = 1000.0  # of a knot: it is a parameter with a name
_USUAL: Final = "300 N*m"  # size of a curve whose author names none: that of dry friction


def add_user_law(core: _core.Machine, s: Structure, entry: Mapping[str, Any], where: str) -> str:
    """Add an expression or a spline to the core; returns its label.

    Raises MachineError or ValueError naming key, value and rule; nothing is added then.
    """
    columns = _columns(entry, where)
    known = _units_known(core, s, str(entry["place"])) | columns
    law = _add_expression if entry["effect"] == "expression" else _add_spline
    return law(core, s, entry, where, known, list(columns.items()))


def _units_known(core: _core.Machine, s: Structure, place: str) -> dict[str, str]:
    """Unit of every name that a law may read on this axis, before its own and recorded ones."""
    rigid = s.drive_train == "rigid"
    signals = {name: unit for name, unit, _ in core.signals()}
    own = {f"{place}.angle": "rad", f"{place}.speed": "rad/s"}
    units = {n: unit_on_axis(n, u, axis=s.axis, rigid=rigid) for n, u in (signals | own).items()}
    angle, speed = (units.pop(f"{place}.{name}") for name in ("angle", "speed"))
    early = {
        n: u for n, u in units.items() if not n.startswith(("alpha_", "energy.")) and "@" not in n
    }
    return {"t": "s", "angle": angle, "speed": speed} | early


def _torque_unit(s: Structure, place: str) -> str:
    return unit_on_axis(f"{place}.torque", "N*m", axis=s.axis, rigid=s.drive_train == "rigid")


def _columns(entry: Mapping[str, Any], where: str) -> dict[str, str]:
    """Recorded columns that the law reads besides the machine's signals: name -> unit."""
    table = expect(entry.get("columns", {}), Mapping, where, "columns", "a table: name = 'unit'")
    for name, unit in table.items():
        expect(unit, str, where, f"columns.{name}", "a unit as text, '' for none")
    return {str(n): _coherent(u, where, f"columns.{n}") for n, u in table.items()}


def _coherent(unit: str, where: str, key: str) -> str:
    """The unit that a formula computes in: as written, if the core knows it, else without prefix.

    Traces hold their columns in the same units.
    """
    try:
        _core.formula_unit("x", {"x": unit})
    except ValueError:
        try:
            return coherent(unit)
        except UnitError as error:
            raise MachineError(f"{where}: {key}: {error}") from None
    return unit


def _check_name(name: str, known: Mapping[str, str]) -> None:
    """Refuse a name that the machine doesn't have, before a run would."""
    if name in known or name.startswith("in."):
        return
    near = get_close_matches(name, known, 3)
    hint = f", did you mean {' or '.join(near)}?" if near else ""
    raise ValueError(
        f"the law reads '{name}', which this machine doesn't have{hint or ';'} "
        f"a recorded column is declared: columns = {{ {name} = 'its unit' }}"
    )


# --- expression -----------------------------------------------------------------------------------


def _add_expression(
    core: _core.Machine,
    s: Structure,
    entry: Mapping[str, Any],
    where: str,
    known: dict[str, str],
    columns: list[tuple[str, str]],
) -> str:
    parameters = _formula_parameters(entry, where)
    formula = expect(entry.get("formula"), str, where, "formula", "text, e.g. 'c*omega_m'")
    for name, _, _ in parameters:
        if name in known:
            rule = "is a signal of this machine or a recorded column; choose another name"
            raise MachineError(f"{where}: parameters.{name}: {rule}")
    known |= {name: unit for name, unit, _ in parameters}
    names = set(_core.formula_names(formula))
    for name in sorted(names):
        _check_name(name, known)
    bare = {name for name, unit, _ in parameters if not unit}
    if not names & bare and names <= known.keys():  # a bare number has no unit to check by
        wanted = _torque_unit(s, entry["place"])
        found = _core.formula_unit(formula, {name: known[name] for name in names})
        if found != wanted:
            what = "a torque" if wanted == "N*m" else "a force"
            raise ValueError(f"formula = {formula!r} gives {found}, not {what} in {wanted}")
    return str(core.add_expression(entry["place"], formula, parameters, columns))


def _formula_parameters(entry: Mapping[str, Any], where: str) -> list[tuple[str, str, float]]:
    table = expect(entry.get("parameters", {}), Mapping, where, "parameters", "a table")
    found = []
    for name, value in table.items():
        item = value if isinstance(value, Mapping) else _stated(value)
        for key in item:
            if key not in ("value", "unit"):
                raise MachineError(f"{where}: parameters.{name}.{key}: unknown; give value, unit")
        if "value" not in item:
            raise MachineError(f"{where}: parameters.{name}: value is missing; give value, unit")
        given = expect(item.get("unit", ""), str, where, f"parameters.{name}.unit", "text")
        key = f"parameters.{name}"
        unit = _coherent(given, where, key)
        try:
            found.append((name, unit, parse(_with_unit(item["value"], given), unit, key=key)))
        except UnitError as error:
            raise MachineError(f"{where}: {error}") from None
    return found


def _with_unit(value: Any, unit: str) -> Any:
    """A plain number is one of the unit stated beside it; text may carry a unit of its own."""
    if isinstance(value, bool) or not unit:
        return value
    match = _NUMBER.fullmatch(str(value).strip())
    return value if match is None else f"{match[0]} {unit}"


def _stated(value: Any) -> dict[str, Any]:
    """A parameter of a formula has the unit that it is given in: ``"3 N*m*s/rad"``."""
    match = _NUMBER.match(value) if isinstance(value, str) else None
    if match is None:
        return {"value": value}
    return {"value": match[0], "unit": value[match.end() :].strip()}


# --- spline ---------------------------------------------------------------------------------------


def _add_spline(
    core: _core.Machine,
    s: Structure,
    entry: Mapping[str, Any],
    where: str,
    known: dict[str, str],
    columns: list[tuple[str, str]],
) -> str:
    names = _per_axis(entry.get("coordinate"), "coordinate", where)
    shape = _knots(entry, where)
    if len(names) != len(shape):
        raise MachineError(
            f"{where}: {len(names)} coordinates, but values or knots along {len(shape)}"
        )
    axes = []
    for k, name in enumerate(names):
        expect(name, str, where, "coordinate", "a name such as 'speed', or two of them")
        _check_name(name, known)
        unit = known.get(name, "")
        ends = (
            parse(_of_axis(entry, key, k, len(names), where), unit, key=key)
            for key in ("low", "high")
        )
        periodic = _of_axis({"periodic": False, **entry}, "periodic", k, len(names), where)
        axes.append(
            (name, *ends, shape[k], expect(periodic, bool, where, "periodic", "true or false"))
        )
    unit = _torque_unit(s, entry["place"])
    size = parse(entry.get("size", _USUAL if unit == "N*m" else "300 N"), unit, key="size")
    values = _plain(entry["values"]) if "values" in entry else _zeros(shape)
    flat = values if len(shape) == 1 else chain.from_iterable(values)
    numbers = [parse(value, unit, key="values") for value in flat]
    return str(core.add_spline(entry["place"], axes, numbers, size, columns))


def _knots(entry: Mapping[str, Any], where: str) -> tuple[int, ...]:
    """How many knots each axis has, from `values`, or from `knots` for a curve of zeros.

    Raises MachineError naming the key and the rule.
    """
    if "values" not in entry:
        counts = _per_axis(entry.get("knots"), "knots", where)
        shape = tuple(expect(n, int, where, "knots", "a whole number of knots") for n in counts)
        if too_much := excess(_BYTES_OF_ONE * math.prod(map(float, shape))):
            raise MachineError(f"{where}: knots = {shown(shape)}: {too_much}; give fewer")
        return shape
    values = _plain(entry["values"])
    if not isinstance(values, list) or not values:
        raise MachineError(f"{where}: values = {values!r}: must be a list, or a list of lists")
    widths = {len(row) if isinstance(row, list) else 0 for row in values}
    if len(widths) > 1:
        raise MachineError(f"{where}: values: every row needs as many numbers as the others")
    width = widths.pop()
    return (len(values), width) if width else (len(values),)


def _plain(values: Any) -> Any:
    """Lists where NumPy's arrays or tuples were given."""
    if hasattr(values, "tolist"):
        return values.tolist()
    return [_plain(v) for v in values] if isinstance(values, list | tuple) else values


def _zeros(shape: tuple[int, ...]) -> list[Any]:
    row = [0.0] * shape[-1]
    return row if len(shape) == 1 else [row] * shape[0]


def curve_entry(axes: Sequence[tuple[str, float, float, int, bool]]) -> dict[str, Any]:
    """The keys of an entry that say what a spline's axes are, as the core has them."""
    names, low, high, _, periodic = ([*of_all] for of_all in zip(*axes, strict=True))
    if len(axes) == 1:
        entry = {"coordinate": names[0], "low": low[0], "high": high[0]}
        return entry | ({"periodic": True} if periodic[0] else {})
    return {"coordinate": names, "low": low, "high": high} | (
        {"periodic": periodic} if any(periodic) else {}
    )


def _per_axis(value: Any, key: str, where: str) -> list[Any]:
    if value is None:
        raise MachineError(
            f"{where}: {key} is missing; a spline takes coordinate, low, high and values"
        )
    return list(value) if isinstance(value, list | tuple) else [value]


def _of_axis(entry: Mapping[str, Any], key: str, axis: int, axes: int, where: str) -> Any:
    """One axis' share of a key that is given once for all, or once per axis."""
    values = _per_axis(entry.get(key), key, where)
    if len(values) not in (1, axes):
        raise MachineError(f"{where}: {key}: give one value, or one per coordinate")
    value = values[axis if len(values) == axes else 0]
    if isinstance(value, float) and not math.isfinite(value):
        raise MachineError(f"{where}: {key} = {value}: must be finite")
    return value
