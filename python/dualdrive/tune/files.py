"""Tables of drive parameters: read from TOML, CSV or JSON, written as text, CSV or JSON."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from dualdrive.files import FileError, read_text
from dualdrive.machine import Machine
from dualdrive.toml_text import TomlError, parse_toml
from dualdrive.tune.errors import TuneError
from dualdrive.tune.known import KNOWN, SLAVE, Base, DriveParameter
from dualdrive.tune.parameters import DriveTable, Entry
from dualdrive.units import UnitError, conversion

__all__ = ["read_drive_parameters", "table_csv", "table_json", "table_text"]

_COLUMNS: Final = ("number", "master", "slave", "unit", "where", "name", "meaning", "source")
_QUANTITY: Final = re.compile(r"\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


# --- out ------------------------------------------------------------------------------------------


def _rows(table: DriveTable) -> list[dict[str, Any]]:
    return [
        {
            "number": number,
            "master": entry.master,
            "slave": entry.slave,
            "unit": entry.parameter.unit,
            "where": entry.parameter.where,
            "name": entry.parameter.name,
            "meaning": entry.parameter.meaning,
            "source": entry.parameter.source,
        }
        for number, entry in table.entries.items()
    ]


def table_text(table: DriveTable) -> str:
    """Aligned columns to type from: five digits, a dash where the control keeps what it has."""
    head = ("number", "name", "value", "unit", "set in", "meaning", "source")
    rows = [head]
    for row in _rows(table):
        given = [v for v in (row["master"], row["slave"]) if v is not None]
        value = " / ".join(f"{v:.5g}" for v in dict.fromkeys(given)) or "-"
        words = (row[key] for key in ("unit", "where", "meaning", "source"))
        rows.append((row["number"], row["name"], value, *words))
    widths = [max(len(row[k]) for row in rows) for k in range(len(head))]
    return "\n".join(
        "  ".join(word.ljust(w) for word, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def table_csv(table: DriveTable) -> str:
    """All digits; an empty cell where an axis has no such number. Reads back to the same values."""
    out = io.StringIO()
    writer = csv.DictWriter(out, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(_rows(table))
    return out.getvalue()


def table_json(table: DriveTable) -> dict[str, Any]:
    """Plain numbers for JSON: number -> master, slave, unit, and who says so."""
    return {row.pop("number"): row for row in _rows(table)}


# --- in -------------------------------------------------------------------------------------------


def read_drive_parameters(path: str | Path, machine: Machine) -> DriveTable:
    """Read a table of the control for this machine, which percentages refer to.

    TOML and JSON: number = value, or number = {master = value, slave = value}; CSV: columns number
    and value, or number, master, slave; other columns are not looked at. A value is a plain number
    in the control's own unit, or text with a unit: ``37264 = "60 N*m"``, ``p1462 = "0.1 s"``.

    Raises FileError for a file that can't be read, TuneError naming file, number, value and rule.
    """
    path = Path(path)
    try:
        given = _given(path)
    except FileNotFoundError:
        raise FileError(f"{path}: there is no such file; check its name") from None
    except TomlError as error:
        raise FileError(f"{path}: {error}") from None
    except (json.JSONDecodeError, csv.Error, RecursionError) as error:
        raise FileError(f"{path}: not {path.suffix[1:].upper()}: {error}") from None
    base = Base(machine)
    entries = {}
    for number, values in given.items():
        parameter = _known(path, number)
        master, slave = (_value(path, parameter, base, values.get(a)) for a in ("master", "slave"))
        if parameter.where == SLAVE and slave is None:
            master, slave = None, master
        entries[parameter.number] = Entry(parameter, master, slave)
    if not entries:
        raise TuneError(f"{path}: no drive parameter in it; write e.g. 37264 = 60")
    return DriveTable(path.name, {n: entries[n] for n in KNOWN if n in entries})


def _given(path: Path) -> dict[str, dict[str, Any]]:
    """Number -> master and slave, as written."""
    kind = path.suffix.lower()
    if kind == ".csv":
        return _from_csv(path)
    if kind == ".toml":
        content = parse_toml(read_text(path))
    elif kind == ".json":
        content = json.loads(read_text(path))
    else:
        raise TuneError(f"{path}: ends in {kind or 'nothing'}; must end in .toml, .csv or .json")
    if not isinstance(content, dict):
        raise TuneError(f"{path}: must be a table of number and value, e.g. 37264 = 60")
    content = content.get("drive_parameters", content)
    return {
        str(number): dict(value) if isinstance(value, Mapping) else _both(number, value)
        for number, value in content.items()
    }


def _from_csv(path: Path) -> dict[str, dict[str, Any]]:
    rows = list(csv.DictReader(io.StringIO(read_text(path), newline="")))
    columns = set(rows[0]) if rows else set()
    if "number" not in columns or not columns & {"value", "master", "slave"}:
        raise TuneError(
            f"{path}: needs a line of column names with number and value, or number, master and "
            f"slave; has {', '.join(map(str, columns)) or 'nothing'}"
        )
    found: dict[str, dict[str, Any]] = {}
    for line, row in enumerate(rows, 2):
        number = (row["number"] or "").strip()
        if number in found:
            raise TuneError(f"{path}, line {line}: {number} stands there twice; leave one")
        split = {axis: row.get(axis) for axis in ("master", "slave")}
        found[number] = split if any(split.values()) else _both(number, row.get("value"))
    return found


def _both(number: object, value: Any) -> dict[str, Any]:
    """One value for all axes that have the number."""
    known = KNOWN.get(_plain(str(number)))
    return {"slave": value} if known and known.where == SLAVE else {"master": value, "slave": value}


def _plain(number: str) -> str:
    return re.sub(r"^\$?(MA_|MD)?\s*", "", number.strip(), flags=re.I).lower()


def _known(path: Path, number: str) -> DriveParameter:
    parameter = KNOWN.get(_plain(number))
    if parameter is None:
        raise TuneError(f"{path}: {number!r}: unknown number; known are {', '.join(KNOWN)}")
    return parameter


def _value(path: Path, parameter: DriveParameter, base: Base, given: Any) -> float | None:
    """In the control's unit; None for an empty cell."""
    where = f"{path}: {parameter.number}"
    if given is None or (isinstance(given, str) and given.strip() in ("", "-")):
        return None
    if isinstance(given, bool) or not isinstance(given, int | float | str):
        raise TuneError(f"{where} = {given!r}: must be a number in {parameter.unit}")
    match = _QUANTITY.fullmatch(str(given))
    if match is None or not math.isfinite(float(match[1])):
        raise TuneError(f"{where} = {given!r}: must be a number in {parameter.unit}, e.g. 1.5")
    number, unit = float(match[1]), match[2]
    if not unit or unit in (parameter.unit, parameter.unit.split()[0]):
        return number
    try:
        si = parameter.si.replace("rad/s^", f"{base.angle}/s^")
        return number * conversion(unit, si).scale / parameter.size(base)
    except UnitError as error:
        raise TuneError(
            f"{where} = {given!r}: {error}; write a number in {parameter.unit}"
        ) from None
