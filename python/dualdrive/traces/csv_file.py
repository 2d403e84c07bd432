"""Text tables: CSV and what recorders export under that name."""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np
from numpy.typing import NDArray

from .arrays import refuse_excess
from .csv_layout import LOOK, Layout, find_layout, measure_text
from .log import Recorder
from .mapping import FileLayout
from .table import Table, unique_names

__all__ = ["read_csv"]

_BLOCK: Final = 50_000  # rows; of ten columns some 10 MB while they are text

_EMPTY = ["", "-", "--", "---", "n/a", "N/A", "NA", "#N/A", "NaN", "nan", "NAN", "-NaN", "-nan"]
_EMPTY += ["null", "NULL", "None", "1.#QNAN", "-1.#IND", "1.#IND", "1,#QNAN"]


def read_csv(path: Path, wanted: FileLayout, recorder: Recorder) -> Table:
    """Read a text table. Raises TraceError where it cannot be told what the file says."""
    encoding, lines = measure_text(path, wanted.encoding, recorder)
    with _text(path, encoding) as file:
        head = [line.removesuffix("\n") for line in islice(file, LOOK)]
    try:
        layout = find_layout(head, wanted, recorder)
    except csv.Error as error:
        way_out = "repair the file, or state [file] delimiter in the mapping"
        longest = csv.field_size_limit()
        endless = any(len(line) > longest for line in head)
        what = f"a cell of more than {longest:,} characters" if endless else str(error)
        raise recorder.error("file", f"no table: {what}", way_out) from None
    names, repeated = unique_names(layout.names, recorder)
    refuse_excess((lines - layout.first) * len(names), recorder)
    columns = _columns(path, encoding, names, lines, layout, recorder)
    table = Table(
        columns,
        np.arange(lines - layout.first, dtype=np.int64) + layout.first + 1,
        units={name: unit for name, unit in layout.units.items() if unit},
        ambiguous=repeated,
        layout={
            "format": "csv",
            "encoding": encoding,
            "delimiter": layout.delimiter,
            "decimal": layout.decimal,
            "header_line": str(layout.header + 1),
        },
    )
    _drop_blank(table, recorder)
    return table


def _text(path: Path, encoding: str) -> TextIO:
    """The text of a file, every kind of line end a line feed."""
    return path.open("r", encoding=encoding)


def _columns(
    path: Path, encoding: str, names: list[str], lines: int, layout: Layout, recorder: Recorder
) -> dict[str, NDArray[Any]]:
    """Columns of numbers as float64, those with any text as objects: str, or None when empty.

    Read block by block, so that only the numbers are held; text is read again as it stands.
    """
    parts: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
    mixed: set[str] = set()
    for block in _blocks(path, encoding, names, lines, layout, recorder):
        kinds = {name: block[name].dtype.kind for name in names if name not in mixed}
        for name, kind in kinds.items():
            truth = bool(parts[name]) and (kind == "b") != (parts[name][-1].dtype.kind == "b")
            if kind in "fiub" and not truth:
                numeric = np.asarray(block[name])
                parts[name].append(numeric if kind == "b" else numeric.astype(np.float64))
            else:
                mixed.add(name)
                parts[name].clear()
    if mixed:
        texts = _blocks(path, encoding, names, lines, layout, recorder, as_text=sorted(mixed))
        for block in texts:
            for name in mixed:
                cells = (None if cell != cell else str(cell).strip() for cell in block[name])
                parts[name].append(np.array([*cells], dtype=object))
    joined = {name: _joined(parts.pop(name)) for name in names}
    rows = len(joined[names[0]])
    if rows != lines - layout.first or any(_has_line_break(joined[name]) for name in mixed):
        rule = f"{lines - layout.first} lines give {rows} rows: a quotation mark is not closed"
        raise recorder.error("file", rule, "repair the file")
    return joined


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    whole = np.concatenate(parts) if parts else np.empty(0)
    return whole.astype(np.float64) if whole.dtype.kind == "b" else whole


def _has_line_break(cells: NDArray[Any]) -> bool:
    return any(cell is not None and "\n" in cell for cell in cells)


def _blocks(
    path: Path,
    encoding: str,
    names: list[str],
    lines: int,
    layout: Layout,
    recorder: Recorder,
    *,
    as_text: list[str] | None = None,
) -> Iterator[Any]:
    """The rows of the table, some at a time, or those columns of it as the text that stands there.

    Raises TraceError for rows that are no rows of this table.
    """
    import pandas as pd

    try:
        with _text(path, encoding) as file, warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # it would drop cells
            for _ in range(layout.first):
                file.readline()
            with pd.read_csv(
                file,
                sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                decimal=layout.decimal,
                header=None,
                names=names + (["\0"] if layout.ends_with_delimiter else []),
                index_col=False,
                na_values=_EMPTY,
                keep_default_na=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
                nrows=lines - layout.first,  # the end of the file is no row
                chunksize=_BLOCK,
                usecols=as_text,
                dtype=str if as_text else None,
            ) as blocks:
                yield from blocks
    except pd.errors.ParserWarning:
        rule = f"rows with more cells than the {len(names)} columns of the header"
        raise recorder.error("column", rule, "repair header or rows") from None
    except pd.errors.ParserError as error:
        found = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error))
        if found is None:
            raise recorder.error("file", str(error), "repair the file") from None
        rule = f"a row has {found[3]} cells, the header names {len(names)} columns"
        row = int(found[2]) + layout.first
        raise recorder.error("column", rule, "repair that row", [row]) from None


def _drop_blank(table: Table, recorder: Recorder) -> None:
    filled = np.zeros(len(table.rows), dtype=bool)
    for column in table.columns.values():
        is_text = column.dtype == object
        filled |= np.array([c is not None for c in column]) if is_text else ~np.isnan(column)
    if not filled.all():
        recorder.add("blank_row", "rows without any value left out", table.rows[~filled])
        table.take(filled)
