"""Tables of targets and positions: one row per approach (long) or one per target (wide)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive.traces.log import Recorder
from dualdrive.traces.mapping import TraceMap
from dualdrive.traces.reading import read_table
from dualdrive.traces.table import Table, numbers, split_header
from dualdrive.units import UnitError, conversion

from .iso230 import Iso230, evaluate
from .rules import IndexingError

__all__ = ["is_position_table", "read_positions"]

Floats = NDArray[np.float64]

_UP: Final = ("up", "fwd", "forward", "+", "1", "+1", "1.0")
_DOWN: Final = ("down", "bwd", "backward", "back", "-", "-1", "-1.0")
_WIDE: Final = re.compile(r"(deviation[ _])?(up|fwd|forward|down|bwd|backward)[ _]?(\d+)", re.I)
_LAYOUTS: Final = (
    "columns target, direction, position (one row per approach), or target, up_1, up_2, ..., "
    "down_1, down_2, ... (one row per target); deviation in place of position"
)


class _Approach(NamedTuple):
    target: float
    up: bool
    position: float


def is_position_table(path: str | Path) -> bool:
    """Whether a CSV file has a column of targets, and so is no trace."""
    with Path(path).open("rb") as file:
        head = file.read(4096).decode("utf-8", "replace")
    cells = (cell.strip(' "') for line in head.splitlines() for cell in re.split(r"[,;\t]", line))
    return any(split_header(cell)[0].lower() == "target" for cell in cells)


def read_positions(
    path: str | Path, *, unit: str = "", travel: float | None = None, name: str = ""
) -> Iso230:
    """Evaluate a measured test that stands in a CSV file as targets and positions.

    unit:    of the columns whose header does not say, ``target [deg]``; arcsec, mm, ...
    travel:  over which the axis is tested, rad or m; else from the first target to the last

    Angles come out in rad, lengths in m. A file with one direction gives one-sided figures.
    Raises IndexingError or TraceError naming file, column or row, rule and way out.
    """
    path = Path(path)
    recorder = Recorder(path, strict=False)
    table = read_table(path, TraceMap(), recorder)
    columns = {name.strip().lower(): name for name in table.columns}
    if "target" not in columns:
        raise IndexingError(f"{path}: no column target; it takes {_LAYOUTS}")
    found = _Columns(path, table, unit)
    wide = {m: c for n, c in columns.items() if (m := _WIDE.fullmatch(n))}
    rows = found.wide(columns["target"], wide) if wide else found.long(columns)
    return _evaluated(rows, found.si, travel, name or path.stem)


class _Columns:
    """The columns of one file in SI; `si` is rad or m, found from the targets' unit."""

    def __init__(self, path: Path, table: Table, unit: str) -> None:
        self.path, self.table, self.unit = path, table, unit
        self.si = ""

    def long(self, columns: Mapping[str, str]) -> list[_Approach]:
        missing = [n for n in ("direction",) if n not in columns]
        value = next((n for n in ("position", "deviation") if n in columns), None)
        if missing or value is None:
            raise IndexingError(f"{self.path}: it takes {_LAYOUTS}")
        targets = self._values(columns["target"])
        values = self._values(columns[value]) + (targets if value == "deviation" else 0.0)
        ways = self.table.columns[columns["direction"]]
        up = [self._is_up(way, row) for way, row in zip(ways, self.table.rows, strict=True)]
        order = np.arange(targets.size)
        if "cycle" in columns:
            order = np.argsort(numbers(self.table.columns[columns["cycle"]])[0], kind="stable")
        return [_Approach(targets[k], up[k], values[k]) for k in order]

    def wide(self, target: str, columns: Mapping[re.Match[str], str]) -> list[_Approach]:
        targets = self._values(target)
        found = []
        for match, column in sorted(columns.items(), key=lambda item: int(item[0][3])):
            values = self._values(column) + (targets if match[1] else 0.0)
            up = match[2] in _UP
            found += [_Approach(t, up, v) for t, v in zip(targets, values, strict=True)]
        return found

    def _is_up(self, way: Any, row: int) -> bool:
        text = str(way).strip().lower()
        if text not in _UP + _DOWN:
            raise IndexingError(
                f"{self.path}: row {row}: direction {way!r}: write up or down (fwd, bwd; 1, -1)"
            )
        return text in _UP

    def _values(self, column: str) -> Floats:
        """A column in rad or m."""
        values, bad = numbers(self.table.columns[column])
        bad |= ~np.isfinite(values)
        if bad.any():
            row = int(self.table.rows[bad.argmax()])
            raise IndexingError(
                f"{self.path}: row {row}: {column}: no number; leave the whole cycle out"
            )
        given = self.table.units.get(column) or self.unit
        if not given:
            raise IndexingError(
                f"{self.path}: {column}: no unit; write it in the header, {column} [deg], or give "
                "--unit (unit=)"
            )
        return values * self._scale(column, given)

    def _scale(self, column: str, given: str) -> float:
        for si in (self.si,) if self.si else ("rad", "m"):
            try:
                scale = conversion(given, si).scale
            except UnitError:
                continue
            self.si = si
            return scale
        wanted = {"rad": "an angle", "m": "a length"}.get(self.si, "an angle or a length")
        raise IndexingError(f"{self.path}: {column} in {given}: must be {wanted}")


def _evaluated(rows: list[_Approach], unit: str, travel: float | None, name: str) -> Iso230:
    ways: dict[bool, dict[float, list[float]]] = {True: {}, False: {}}
    for row in rows:
        ways[row.up].setdefault(float(row.target), []).append(float(row.position))
    up, down = ways[True], ways[False]
    if not up:
        up, down = down, up
    if down and set(up) != set(down):
        odd = min(set(up) ^ set(down))
        side = "from below" if odd in up else "from above"
        raise IndexingError(
            f"{name}: target {odd:g} {unit} was approached {side} only: both directions must have "
            "the same targets"
        )
    targets = sorted(up)
    below = [up[t] for t in targets]
    above = [down[t] for t in targets] if down else None
    return evaluate(targets, below, above, unit=unit, travel=travel, name=name)
