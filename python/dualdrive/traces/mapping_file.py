"""Reading and writing mapping files."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, TypeVar

from dualdrive.echo import shown
from dualdrive.files import FileError, read_text
from dualdrive.toml_text import TomlError, parse_toml
from dualdrive.units import UnitError, parse

from .atomic import write_atomically
from .log import TraceError
from .mapping import ColumnRule, FileLayout, RowRule, SplitRule, TimeRule, TraceMap

__all__ = ["find_mapping", "mapping_from", "mapping_text", "read_mapping", "write_mapping"]

SUFFIX: Final = ".map.toml"

_CHOICES: Final[dict[str, tuple[object, ...]]] = {
    "file.format": ("csv", "hdf5", "mat"),
    "file.decimal": (".", ","),
    "time.backwards": ("refuse", "split"),
    "time.repeated": ("refuse", "first", "last", "spread"),
    "columns.sign": (1, -1),
    "columns.current": ("rms", "peak"),
    "columns.reset": ("split", "continue", "keep"),
    "columns.missing": ("drop", "interpolate", "hold"),
}
_DURATIONS: Final = ("sample_time", "gap", "settle", "min_time")
_PATTERN: Final = re.compile(r"[^%]*(%[aAbBcdfHIjmMpSuUwWxXyYzZ%][^%]*)+")
#: key -> rule, way out, test of what means something only in one form
_FORMS: Final[dict[str, tuple[str, str, Callable[[Any], bool]]]] = {
    "file.delimiter": (
        "must be one character that is in no number",
        'write e.g. ";" or "\\t"',
        lambda text: len(text) == 1 and not text.isalnum() and text not in "\"'+-.\r\n\0_",
    ),
    "time.format": (
        "no pattern of a time",
        'write iso, or e.g. "%d.%m.%Y %H:%M:%S,%f"',
        lambda text: text == "iso" or bool(_PATTERN.fullmatch(text)),
    ),
    "columns.sign_bit": (
        "must be the number of a bit, 0 to 52",
        "write e.g. 15, or leave it out",
        lambda bit: 0 <= bit <= 52,  # what a float64 counts exactly
    ),
    "file.header_line": ("must be a line, 1 for the first", "write e.g. 3", lambda line: line >= 1),
}
_Rule = TypeVar("_Rule", FileLayout, TimeRule, ColumnRule, RowRule, SplitRule)


def find_mapping(path: str | Path) -> Path | None:
    """Return the mapping beside a recording, ``log10.csv`` -> ``log10.map.toml``, if there is one.

    A ``traces.map.toml`` in the same folder serves all recordings that have none of their own.
    """
    path = Path(path)
    if not path.name:  # "." and "/": folders, whoever reads them says so
        return None
    candidates = (path.with_suffix(SUFFIX), path.with_name("traces" + SUFFIX))
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def read_mapping(path: str | Path) -> TraceMap:
    """Read a mapping file. Raises TraceError naming file, key, value, rule and way out."""
    path = Path(path)
    try:
        tables = parse_toml(read_text(path))
    except FileNotFoundError:
        message = f"{path}: there is no such file; check the name given as mapping"
        raise TraceError(message, kind="mapping") from None
    except FileError as error:
        message = f"{error}; check the name given as mapping"
        raise TraceError(message, kind="mapping") from None
    except TomlError as error:
        raise TraceError(f"{path.name}: {error}", kind="mapping") from None
    return mapping_from(tables, origin=path.name)


def mapping_from(tables: Mapping[str, Any], origin: str = "mapping") -> TraceMap:
    """Make a mapping of nested plain values. Raises TraceError like `read_mapping`."""
    _known(tables, ("file", "time", "columns", "rows", "split"), origin, "")
    columns = tables.get("columns", {})
    if not isinstance(columns, Mapping):
        raise _bad(origin, "columns", columns, "must be tables", 'write [columns."Name"]')
    mapping = TraceMap(
        file=_rule(FileLayout, tables.get("file", {}), origin, "file"),
        time=_rule(TimeRule, tables.get("time", {}), origin, "time"),
        columns={
            name: _rule(ColumnRule, table, origin, f'columns."{name}"')
            for name, table in columns.items()
        },
        rows=_rule(RowRule, tables.get("rows", {}), origin, "rows"),
        split=_rule(SplitRule, tables.get("split", {}), origin, "split"),
        origin=origin,
    )
    _no_channel_twice(mapping, origin)
    return mapping


def _bad(origin: str, key: str, value: object, rule: str, way_out: str) -> TraceError:
    return TraceError(f"{origin}: {key} = {shown(value)}: {rule}; {way_out}", kind="mapping")


def _known(table: Mapping[str, Any], names: Iterable[str], origin: str, key: str) -> None:
    allowed = list(names)
    for name in table:
        if name not in allowed:
            close = difflib.get_close_matches(name, allowed, n=1)
            way_out = f"did you mean {close[0]}?" if close else f"known: {', '.join(allowed)}"
            where = f"{key}.{name}" if key else name
            raise TraceError(f"{origin}: {where}: unknown key; {way_out}", kind="mapping")


def _rule(kind: type[_Rule], table: Any, origin: str, key: str) -> _Rule:
    if not isinstance(table, Mapping):
        raise _bad(origin, key, table, "must be a table", f"write [{key}] and its keys below")
    standard = kind()
    _known(table, (f.name for f in fields(kind)), origin, key)
    values = {
        name: _value(value, getattr(standard, name), origin, f"{key}.{name}", name)
        for name, value in table.items()
    }
    return kind(**values)


def _value(value: Any, standard: Any, origin: str, key: str, name: str) -> Any:
    """Check one value against the type of its default and the choices there are."""
    place = f"{key.partition('.')[0]}.{name}"
    choice = _CHOICES.get(place)
    if choice is not None and (isinstance(value, bool) or value not in choice):
        choices = " or ".join(map(str, choice))
        raise _bad(origin, key, value, "not one of the choices", f"write {choices}")
    if isinstance(standard, tuple):
        return _items(value, origin, key, name)
    if name == "wrap" and key.startswith("columns"):
        return _wrap(value, origin, key)
    if name == "scale":
        return _scale(value, origin, key)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    fits = {
        bool: isinstance(value, bool),
        int: number and float(value).is_integer(),
        float: number and math.isfinite(value),
        str: isinstance(value, str),
    }
    kind = type(standard)
    if not fits[kind]:
        what = {bool: "true or false", int: "a whole number", float: "a finite number"}
        raise _bad(origin, key, value, f"must be {what.get(kind, 'text')}", "correct the value")
    if place in _FORMS and value != "":
        rule, way_out, fits_form = _FORMS[place]
        if not fits_form(value):
            raise _bad(origin, key, value, rule, way_out)
    if name in _DURATIONS:
        duration(value, f"{origin}: {key}")
    return kind(value)


def _items(value: Any, origin: str, key: str, name: str) -> tuple[Any, ...]:
    kind: Any = int | float if name == "missing" else str
    listed = value if isinstance(value, list) else [value]
    if any(not isinstance(item, kind) or isinstance(item, bool) for item in listed):
        what = "numbers" if name == "missing" else "texts"
        raise _bad(origin, key, value, f"must be a list of {what}", 'write e.g. ["a", "b"]')
    return tuple(listed)


def _wrap(value: Any, origin: str, key: str) -> bool | float:
    if isinstance(value, bool):
        return value
    if isinstance(value, int | float) and value > 0:
        return float(value)
    rule = "must be true, false or the raw value of one turn"
    raise _bad(origin, key, value, rule, "write e.g. 4096")


def _scale(value: Any, origin: str, key: str) -> float | str:
    try:
        number = float(Fraction(value)) if isinstance(value, str) else float(value)
    except (ValueError, TypeError, ArithmeticError):
        number = 0.0
    if number == 0 or not math.isfinite(number) or isinstance(value, bool) or "_" in str(value):
        rule = "must be a finite number other than zero, or a fraction"
        raise _bad(origin, key, value, rule, 'write e.g. 0.001 or "1/4096"')
    return value if isinstance(value, str) else number


def duration(text: str, key: str) -> float:
    """A positive time in seconds; raises TraceError."""
    try:
        value = parse(text, "s", key=key)
    except UnitError as error:
        raise TraceError(str(error), kind="mapping") from None
    if value <= 0:
        raise TraceError(f"{key} = {text!r}: must be positive; write e.g. 10ms", kind="mapping")
    return value


def _no_channel_twice(mapping: TraceMap, origin: str) -> None:
    seen: dict[str, str] = {}
    for column, rule in mapping.columns.items():
        channel = rule.channel or column
        if channel in seen:
            message = f"{origin}: columns {seen[channel]!r} and {column!r} both give {channel}"
            raise TraceError(f"{message}; give each its own channel", kind="mapping")
        seen[channel] = column


def write_mapping(mapping: TraceMap, path: str | Path) -> Path:
    """Write a mapping file that `read_mapping` reads back equal; a guess's notes are comments.

    Raises TraceError where it cannot be written; then nothing is left behind.
    """
    path = Path(path)
    with write_atomically(path) as temporary:
        temporary.write_text(mapping_text(mapping), encoding="utf-8")
    return path


def mapping_text(mapping: TraceMap) -> str:
    """What `write_mapping` writes."""
    import tomlkit

    document = tomlkit.document()
    for note in mapping.notes:
        document.add(tomlkit.comment(note))
    for name, table in mapping.as_dict().items():
        document.add(name, tomlkit.item(table))
    return tomlkit.dumps(document)
