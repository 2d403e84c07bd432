"""Finding out how a text file is laid out: encoding, delimiter, decimal sign, header, units row."""

from __future__ import annotations

import codecs
import csv
import re
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Final

from .log import Recorder
from .mapping import FileLayout
from .table import split_header

__all__ = ["LOOK", "Layout", "count_columns", "find_layout", "measure_text", "split_line"]

LOOK: Final = 400  # lines looked at
_BLOCK: Final = 2**20  # characters
_BOMS: Final = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_POINT: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)", re.IGNORECASE)
_COMMA: Final = re.compile(r"[+-]?(\d+(,\d*)?|,\d+)([eE][+-]?\d+)?")
_DAY = r"(\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ])?"
_CLOCK: Final = re.compile(_DAY + r"\d{1,2}:\d\d(:\d\d)?([.,:]\d+)? ?(AM|PM|Z|[+-]\d\d:?\d\d)?")
_SPACES: Final = " "


@dataclass(frozen=True)
class Layout:
    """Where the table is in a text. Lines are counted from 0 here."""

    delimiter: str
    decimal: str
    names: list[str]
    units: dict[str, str]
    first: int  # first line of data
    header: int  # line of the header, -1 when the names were given
    width: int
    ends_with_delimiter: bool  # every line does


def measure_text(path: Path, encoding: str, recorder: Recorder) -> tuple[str, int]:
    """Return the encoding of a text, and its lines up to the last that isn't blank.

    Tried: byte order mark, UTF-16 by its zeros, UTF-8, cp1252, which accepts nearly anything.
    """
    with path.open("rb") as file:
        head = file.read(400)
    if not encoding:
        encoding = next((name for bom, name in _BOMS if head.startswith(bom)), "")
    if not encoding and b"\0" in head:
        encoding = "utf-16-le" if head[1::2].count(0) > head[0::2].count(0) else "utf-16-be"
    for candidate in (encoding,) if encoding else ("utf-8", "cp1252"):
        try:
            return candidate, _count_lines(path, candidate)
        except (UnicodeError, LookupError):
            continue
    tried = encoding or "UTF-8 or Windows-1252"
    raise recorder.error("file", f"not text in {tried}", "state [file] encoding in the mapping")


def _count_lines(path: Path, encoding: str) -> int:
    ends = filled = 0
    with path.open("r", encoding=encoding) as file:
        while block := file.read(_BLOCK):
            if within := block.rstrip():
                filled = ends + within.count("\n") + 1
            ends += block.count("\n")
    return filled


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of one line."""
    if delimiter == _SPACES:  # a unit in brackets belongs to the name before it
        return [cell.strip('"') for cell in re.split(r"\s+(?![\[(])", line.strip())]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


def find_layout(lines: list[str], wanted: FileLayout, recorder: Recorder) -> Layout:
    """Find the table in the lines of a text; what `wanted` states is taken as it is."""
    looked = [(i, line) for i, line in enumerate(lines) if line.strip()]
    if not looked:
        raise recorder.error("file", "the file is empty", "export the recording again")
    delimiter = _delimiter(looked, wanted)
    cells = [(i, split_line(line, delimiter)) for i, line in looked]
    decimal = wanted.decimal or _decimal([row for _, row in cells], delimiter)
    first, header = _first_rows(cells, wanted, decimal, recorder)
    width = len(dict(cells)[first])
    names, units = _header(dict(cells), header, first, wanted, recorder)
    closed = delimiter != _SPACES and width == len(names) + 1 and not dict(cells)[first][-1]
    width -= closed
    if len(names) > width and not any(names[width:]):
        names = names[:width]
    if len(names) != width:
        rule = f"the header names {len(names)} columns, the first row has {width}"
        way_out = "correct the header, or state [file] header_line or names in the mapping"
        raise recorder.error("column", rule, way_out, [first + 1])
    return Layout(delimiter, decimal, names, units, first, header, width, closed)


def count_columns(path: Path, recorder: Recorder) -> int:
    """How many columns the rows of a text table have, with or without a header."""
    encoding, _ = measure_text(path, "", recorder)
    with path.open(encoding=encoding) as file:
        looked = [(i, line) for i, line in enumerate(islice(file, LOOK)) if line.strip()]
    row = split_line(looked[-1][1].rstrip("\n"), _delimiter(looked, FileLayout()))
    return len(row) - (not row[-1])


def _delimiter(looked: list[tuple[int, str]], wanted: FileLayout) -> str:
    delimiters = (wanted.delimiter,) if wanted.delimiter else (";", "\t", ",", "|", _SPACES)
    return max(delimiters, key=lambda d: _table_likeness(looked, d))


def _table_likeness(looked: list[tuple[int, str]], delimiter: str) -> tuple[float, int]:
    """How much the lower half of the lines looks like a table under this delimiter."""
    tail = [split_line(line, delimiter) for _, line in looked[len(looked) // 2 :]]
    widths = [len(row) for row in tail]
    width = max(set(widths), key=widths.count)
    rows = [row for row in tail if len(row) == width]
    filled = [cell for row in rows for cell in row if cell]
    likely = sum(map(_is_value, filled)) / max(len(filled), 1)
    return likely * len(rows) / len(tail) * (1.0 if width > 1 else 0.5), width


def _is_value(cell: str, decimal: str = "") -> bool:
    number = (_POINT if decimal != "," else _COMMA).fullmatch(cell)
    if number is None and not decimal:
        number = _COMMA.fullmatch(cell)
    return number is not None or _CLOCK.fullmatch(cell) is not None


def _decimal(rows: list[list[str]], delimiter: str) -> str:
    if delimiter == ",":
        return "."
    cells = [cell for row in rows for cell in row]
    commas = sum("," in cell and _COMMA.fullmatch(cell) is not None for cell in cells)
    points = sum("." in cell and _POINT.fullmatch(cell) is not None for cell in cells)
    return "," if commas > points else "."


def _first_rows(
    cells: list[tuple[int, list[str]]], wanted: FileLayout, decimal: str, recorder: Recorder
) -> tuple[int, int]:
    """Lines of the first data row and of the header (-1 for none)."""

    def is_data(position: int) -> bool:
        filled = [cell for cell in cells[position][1] if cell]
        return 2 * sum(_is_value(cell, decimal) for cell in filled) > len(filled) > 0

    start = 0
    if wanted.header_line:
        start = next((k for k, (i, _) in enumerate(cells) if i >= wanted.header_line), len(cells))
    found = [k for k in range(start, len(cells)) if is_data(k)]
    widths = [len(cells[k][1]) for k in found]
    usual = max(set(widths), key=widths.count) if widths else 0
    first = next((k for k in found if len(cells[k][1]) == usual), None)
    if first is None:
        raise recorder.error("file", "no row of numbers", "check delimiter and decimal sign")
    if wanted.names:
        return cells[first][0], -1
    if wanted.header_line:
        return cells[first][0], wanted.header_line - 1
    named = first - 1
    if named > 0 and _is_unit_row(cells[named][1], len(cells[first][1])):
        named -= 1
    if named < 0 or len(cells[named][1]) < usual - 1:
        rule = "no header above the numbers"
        way_out = "add a line of column names, or state [file] names in the mapping"
        raise recorder.error("column", rule, way_out, [cells[first][0] + 1])
    return cells[first][0], cells[named][0]


def _is_unit_row(row: list[str], width: int) -> bool:
    """A row such as ``s; mm; N*m`` or ``[s]; [mm]; ()`` between header and numbers."""
    if len(row) not in (width, width + 1):
        return False
    return any(row) and all(not cell or _unit_of(cell) is not None for cell in row)


def _unit_of(cell: str) -> str | None:
    bare = cell.strip().removeprefix("[").removesuffix("]").removeprefix("(").removesuffix(")")
    name, unit = split_header(f"x ({bare})")
    return unit if name == "x" and unit else "" if bare in ("", "-", "1") else None


def _header(
    cells: dict[int, list[str]], header: int, first: int, wanted: FileLayout, recorder: Recorder
) -> tuple[list[str], dict[str, str]]:
    """Names of the columns and the units stated beside or below them."""
    row = list(wanted.names) if wanted.names else cells.get(header)
    if row is None:
        rule = f"line {header + 1} is stated to be the header but is empty"
        raise recorder.error("mapping", rule, "correct [file] header_line", [header + 1])
    row = [row[0].lstrip("#%! "), *row[1:]]
    split = [split_header(cell) for cell in row]
    below = [cells[i] for i in sorted(cells) if header < i < first] if header >= 0 else []
    units = {name: unit for name, unit in split if unit}
    if below and _is_unit_row(below[-1], len(row)):
        for (name, _), cell in zip(split, below[-1], strict=False):
            units.setdefault(name, _unit_of(cell) or "")
    return [name for name, _ in split], units
