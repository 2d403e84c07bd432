"""Text tables: CSV and what recorders export under that name."""

from __future__ import annotations

import io
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .csv_layout import Layout, decode, find_layout, split_line
from .log import Recorder
from .mapping import FileLayout
from .table import Table, unique_names

__all__ = ["read_csv"]

_EMPTY = ["", "-", "--", "---", "n/a", "N/A", "NA", "#N/A", "NaN", "nan", "NAN", "-NaN", "-nan"]
_EMPTY += ["null", "NULL", "None", "1.#QNAN", "-1.#IND", "1.#IND", "1,#QNAN"]


def read_csv(path: Path, wanted: FileLayout, recorder: Recorder) -> Table:
    """Read a text table. Raises TraceError where it cannot be told what the file says."""
    text, encoding = decode(path.read_bytes(), wanted.encoding, recorder)
    lines = text.split("\n")
    layout = find_layout(lines, wanted, recorder)
    names, repeated = unique_names(layout.names, recorder)
    frame = _frame(lines[layout.first :], names, layout, recorder)
    columns = {name: _column(frame[name]) for name in names}
    rows = np.arange(len(frame), dtype=np.int64) + layout.first + 1
    table = Table(
        columns,
        rows,
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


def _frame(lines: list[str], names: list[str], layout: Layout, recorder: Recorder) -> Any:
    import pandas as pd

    while lines and not lines[-1].strip():
        lines = lines[:-1]  # the end of the file is no row
    trailing = ["\0"] if _ends_with_delimiter(lines[0], layout) else []
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # it would drop cells
            frame = pd.read_csv(
                io.StringIO("\n".join(lines)),
                sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                decimal=layout.decimal,
                header=None,
                names=names + trailing,
                index_col=False,
                na_values=_EMPTY,
                keep_default_na=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
            )
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
    if len(frame) != len(lines):
        rule = f"{len(lines)} lines give {len(frame)} rows: a quotation mark is not closed"
        raise recorder.error("file", rule, "repair the file")
    return frame


def _ends_with_delimiter(line: str, layout: Layout) -> bool:
    return layout.delimiter != " " and len(split_line(line, layout.delimiter)) == layout.width + 1


def _column(series: Any) -> NDArray[Any]:
    """A column of numbers as float64, one with any text as objects: str, or None when empty."""
    if series.dtype.kind in "fiub":
        return np.asarray(series, dtype=np.float64)
    cells = series.astype(object)
    return np.array([None if cell != cell else str(cell).strip() for cell in cells], dtype=object)


def _drop_blank(table: Table, recorder: Recorder) -> None:
    filled = np.zeros(len(table.rows), dtype=bool)
    for column in table.columns.values():
        is_text = column.dtype == object
        filled |= np.array([c is not None for c in column]) if is_text else ~np.isnan(column)
    if not filled.all():
        recorder.add("blank_row", "rows without any value left out", table.rows[~filled])
        table.take(filled)
