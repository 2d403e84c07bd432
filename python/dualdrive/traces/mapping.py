"""How a file that was not written for dualdrive becomes a trace: a small TOML beside it.

    [file]                     layout, only where it cannot be seen from the file
    [time]                     which column is the clock, and what to do about its faults
    [columns."Name in file"]   channel, unit, sign, scale, offset, ...
    [rows]                     rows to keep and to drop, by conditions on columns
    [split]                    where a new part begins

A value of a column becomes ``sign * (scale * raw + offset)`` in `unit`, and then SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

__all__ = ["ColumnRule", "FileLayout", "RowRule", "SplitRule", "TimeRule", "TraceMap"]


@dataclass(frozen=True, slots=True)
class FileLayout:
    """Layout of the file; what is left out is found by looking at it."""

    format: str = ""  # csv, hdf5, mat
    encoding: str = ""
    delimiter: str = ""
    decimal: str = ""
    header_line: int = 0  # 1 is the first line
    names: tuple[str, ...] = ()  # column names of a file without a header
    missing: tuple[float, ...] = ()  # numbers that stand for "no value"
    group: str = ""  # group of an HDF5 file, variable of a MAT file
    ignore: tuple[str, ...] = ()  # columns to leave out; * and ? match, mapped ones stay


@dataclass(frozen=True, slots=True)
class TimeRule:
    """The clock of a recording."""

    column: str = ""
    unit: str = ""  # of a column of numbers: s, ms, us, min
    format: str = ""  # of a column of dates: iso, or a pattern such as %d.%m.%Y %H:%M:%S,%f
    sample_time: str = ""  # the true step where there is no clock column or it is not to be used
    wrap: float = 0.0  # raw value at which the clock's counter starts again, e.g. 65536
    gap: str = ""  # a longer step ends a segment; 10 median steps when left out
    backwards: str = "refuse"  # refuse | split
    repeated: str = "refuse"  # refuse | first | last | spread
    zero: bool = False  # start at t = 0; a column of dates always does


@dataclass(frozen=True, slots=True)
class ColumnRule:
    """One column: which channel it is and how its raw numbers become SI."""

    channel: str = ""  # canonical or own name; the column's name when left out
    unit: str = ""
    sign: int = 1
    scale: float | str = 1.0  # a number or a fraction such as "1/4096"
    offset: float = 0.0
    of: str = ""  # what 100 % stands for, e.g. "100 N*m"
    radius: str = ""  # a length on this radius is an angle, a force on it a torque
    current: str = ""  # rms | peak: phase current of a synchronous motor
    sign_bit: int = -1  # bit that carries the sign of a raw count; those below are the magnitude
    wrap: bool | float = True  # unwrap: by itself, never, or at this raw period
    reset: str = "split"  # a counter that is set back: split | continue | keep
    missing: str = ""  # drop | interpolate | hold; drop for channels, hold for extra ones
    long_name: str = ""


@dataclass(frozen=True, slots=True)
class RowRule:
    """Rows to use. Conditions are ``column operator value``: all of keep, none of drop."""

    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SplitRule:
    """Where parts begin: at every change of one of the columns in `by`."""

    by: tuple[str, ...] = ()
    settle: str = ""  # time to leave out at the start of each part
    min_time: str = ""  # shorter parts are left out


@dataclass(frozen=True, slots=True)
class TraceMap:
    """How to read one kind of file. Immutable; made by `read_mapping` or `guess_mapping`."""

    file: FileLayout = field(default_factory=FileLayout)
    time: TimeRule = field(default_factory=TimeRule)
    columns: Mapping[str, ColumnRule] = field(default_factory=dict)
    rows: RowRule = field(default_factory=RowRule)
    split: SplitRule = field(default_factory=SplitRule)
    notes: tuple[str, ...] = ()  # a guess's reasons, written as comments
    origin: str = ""  # the file it was read from

    def as_dict(self) -> dict[str, Any]:
        """The mapping as nested plain values, without what equals the default."""
        tables: dict[str, Any] = {
            name: _changed(getattr(self, name)) for name in ("file", "time", "rows", "split")
        }
        tables["columns"] = {name: _changed(rule) for name, rule in self.columns.items()}
        return {name: table for name, table in tables.items() if table}


def _changed(rule: Any) -> dict[str, Any]:
    values = {f.name: getattr(rule, f.name) for f in fields(rule)}
    plain = {name: list(v) if isinstance(v, tuple) else v for name, v in values.items()}
    standard = type(rule)()
    return {name: v for name, v in plain.items() if values[name] != getattr(standard, name)}
