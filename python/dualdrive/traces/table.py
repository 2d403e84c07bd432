"""A file's columns as they stand in it, before anything is interpreted."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.units import is_unit

from .log import Recorder

__all__ = ["Table", "find_column", "numbers", "split_header", "unique_names"]

_BRACKETS = re.compile(r"(.*\S)\s*\[([^\[\]]*)\]")
_PARENTHESES = re.compile(r"(.*\S)\s*\(([^()]*)\)")
_WORDS = re.compile(r"(.*\S)\s+(?:in|/)\s+(\S+)")


@dataclass
class Table:
    """Columns of one file. Arrays of numbers are float64, columns of text hold str or None.

    rows:       for each row its number in the file, as a text editor counts (binary: from 1)
    units:      unit of a column where the file states one
    constants:  single numbers beside the columns (MAT and HDF5)
    layout:     what was found out about the file, for the provenance
    """

    columns: dict[str, NDArray[Any]]
    rows: NDArray[np.int64]
    units: dict[str, str] = field(default_factory=dict)
    long_names: dict[str, str] = field(default_factory=dict)
    constants: dict[str, float] = field(default_factory=dict)
    layout: dict[str, str] = field(default_factory=dict)
    ambiguous: frozenset[str] = frozenset()  # names that stand over more than one column
    unused: frozenset[str] = frozenset()  # names of what is in the file and no column

    def take(self, mask: NDArray[np.bool_]) -> None:
        """Keep the rows where `mask` is true."""
        self.rows = self.rows[mask]
        self.columns = {name: column[mask] for name, column in self.columns.items()}


def split_header(cell: str) -> tuple[str, str]:
    """Return name and unit of a header cell: ``theta_m [arcsec]``, ``t (ms)``, ``T in N*m``.

    Square brackets always hold a unit; round ones and words only where it is one.
    """
    cell = cell.strip()
    if match := _BRACKETS.fullmatch(cell):
        return match[1].strip(), match[2].strip()
    for pattern in (_PARENTHESES, _WORDS):
        match = pattern.fullmatch(cell)
        if match and re.search(r"[^\W\d]|[%°″′]", match[2]) and _unit_like(match[2].strip()):
            return match[1].strip(), match[2].strip()
    return cell, ""


def _unit_like(text: str) -> bool:
    return current_kind(text)[1] != "" or is_unit(text)


def current_kind(unit: str) -> tuple[str, str]:
    """Split ``A_rms``, ``mArms``, ``Apk``, ``Aeff`` into unit and ``rms`` or ``peak``, if any."""
    match = re.fullmatch(r"([mk]?A)[ _]?(rms|RMS|eff|pk|peak|Peak)", unit)
    if match is None:
        return unit, ""
    return match[1], "rms" if match[2].lower() in ("rms", "eff") else "peak"


def unique_names(names: list[str], recorder: Recorder) -> tuple[list[str], frozenset[str]]:
    """Number repeated and name empty columns; return the names and those that were not unique."""
    count: dict[str, int] = {}
    unique: list[str] = []
    for position, name in enumerate(names, start=1):
        name = name or f"column {position}"
        count[name] = count.get(name, 0) + 1
        unique.append(name if count[name] == 1 else f"{name} ({count[name]})")
    repeated = frozenset(name for name, times in count.items() if times > 1)
    for name in sorted(repeated):
        recorder.add("duplicate_column", f"{count[name]} columns are called {name!r}")
    return unique, repeated


def find_column(table: Table, name: str, recorder: Recorder, *, why: str) -> str:
    """Return the column's name in the table; raises TraceError when it is missing or ambiguous."""
    if name in table.ambiguous:
        rule = f"{why} {name!r}: more than one column has that name"
        raise recorder.error("duplicate_column", rule, "give the columns different names")
    if name in table.columns:
        return name
    stripped = split_header(name)[0]
    if stripped in table.columns and stripped not in table.ambiguous:
        return stripped
    close = difflib.get_close_matches(name, table.columns, n=1)
    known = ", ".join(list(table.columns)[:12]) + (" ..." if len(table.columns) > 12 else "")
    way_out = f"did you mean {close[0]!r}?" if close else f"the file has: {known}"
    raise recorder.error("column", f"{why} {name!r}: no such column", way_out)


def numbers(column: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return a column as float64 (NaN where empty) and a mask of cells that are not numbers."""
    if column.dtype != object:
        return column.astype(np.float64), np.zeros(len(column), dtype=bool)
    values = np.full(len(column), np.nan)
    bad = np.zeros(len(column), dtype=bool)
    for i, cell in enumerate(column):
        if cell is None:
            continue
        try:
            values[i] = float(cell)
            bad[i] = "_" in cell  # 1_0 is a number to Python alone
        except ValueError:
            bad[i] = True
    values[bad] = np.nan
    return values, bad
