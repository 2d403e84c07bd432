"""Tables 1 and 2: indexing accuracy of the traditional and of the dual-motor table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dualdrive.paper.exhibit import Claim, Exhibit, Number, Table, verdict

if TYPE_CHECKING:
    from dualdrive.indexing import TableRow

__all__ = ["Tables", "table1", "table2"]

_WORDS = {"A": "bidirectional accuracy A", "R": "repeatability R", "B": "reversal value B"}


@dataclass(frozen=True)
class Tables:
    """What the picture is drawn from: the rows of `dualdrive.indexing.table`."""

    rows: tuple[TableRow, ...]


def table1(jobs: int = 1) -> Exhibit:
    """Indexing accuracy without a workpiece beside the printed one."""
    rows = _measured(("empty",), jobs)
    return _exhibit(
        "table1",
        "Table 1: indexing accuracy without load",
        "The paper measured the traditional table and the one with two motors with a laser "
        "interferometer, unloaded. Here both run the same test of ISO 230-2 in simulation.",
        rows,
        "more than 50 %",
        50.0,
    )


def table2(jobs: int = 1) -> Exhibit:
    """Indexing accuracy under three workpieces beside the printed one."""
    rows = _measured(("100t", "250t", "550t"), jobs)
    return _exhibit(
        "table2",
        "Table 2: indexing accuracy under load",
        "The paper bored two holes of 100 mm on workpieces of 100, 250 and 550 t. Here the "
        "accuracy A of ISO 230-2 with these masses on the table.",
        rows,
        "more than 56 %",
        56.0,
    )


def _measured(loads: tuple[str, ...], jobs: int) -> tuple[TableRow, ...]:
    from dualdrive.indexing import table

    return tuple(table(loads=loads, jobs=jobs))


def _exhibit(
    name: str, title: str, about: str, rows: tuple[TableRow, ...], claimed: str, least: float
) -> Exhibit:
    from dualdrive.indexing import FLOOR

    reasons = dict.fromkeys(row.reason for row in rows)
    letters = {reason: f"({letter})" for letter, reason in zip("abcdefgh", reasons, strict=False)}
    return Exhibit(
        name=name,
        title=title,
        about=about,
        chosen=(
            "traditional: heavy-table-double-pinion, one motor with play ahead of a preloaded "
            "split shaft; double motors: heavy-table-dual-servo, tension 60 N·m; the same play and "
            "stiffness in both",
            "ISO 230-2: eight targets round the circle, five cycles in both directions; the "
            "position loop is closed on the table's encoder every 4 ms, with the floor and without",
            *(
                f"floor from outside the drive model, the same for both tables: {f.effect}: {f.why}"
                for f in FLOOR
            ),
        ),
        numbers=tuple(
            Number(_what(row), "″", row.printed, row.with_floor, letters[row.reason])
            for row in rows
            if row.printed is not None
        ),
        claims=(_gain(rows, claimed, least),),
        tables=(_alone(rows),),
        notes=(
            *(f"{letter} {reason}" for reason, letter in letters.items()),
            "A drive model alone lands well below 3 to 4″: what is left of a measured table comes "
            "from its scale, bearing, ring and instrument. The column without floor is the drives' "
            "own part, and nothing was tuned to the printed digits.",
        ),
        data=Tables(rows),
    )


def _what(row: TableRow) -> str:
    load = "unloaded" if row.load == "empty" else row.load.replace("t", " t")
    return f"{row.column}, {load}: {_WORDS[row.figure]}"


def _gain(rows: Sequence[TableRow], claimed: str, least: float) -> Claim:
    """By how much the dual table is better, printed and found."""
    printed = _gains(rows, "printed")
    found = _gains(rows, "with_floor")
    return Claim(
        f"the dual table is better by {claimed}",
        f"by the printed table {_percent(printed)}; here {_percent(found)}",
        verdict(*(gain > least for gain in found.values())),
    )


def _gains(rows: Sequence[TableRow], column: str) -> dict[str, float]:
    """By how much the dual table's figure is smaller, % of the traditional one's."""
    values = {(r.load, r.figure, r.column): getattr(r, column) for r in rows}
    gains = {}
    for load, figure in dict.fromkeys((r.load, r.figure) for r in rows):
        old, new = (values.get((load, figure, c)) for c in ("traditional", "double motors"))
        if old and new is not None:
            key = figure if load == "empty" else load.replace("t", " t")
            gains[key] = 100.0 * (1.0 - new / old)
    return gains


def _percent(gains: dict[str, float]) -> str:
    return ", ".join(f"{key} {gain:.0f} %" for key, gain in gains.items())


def _alone(rows: Sequence[TableRow]) -> Table:
    cells = tuple(
        (_what(r), r.printed, None if r.alone is None else f"{r.alone:.3f}", r.with_floor)
        for r in rows
    )
    columns = ("", "printed [″]", "drive model alone [″]", "with floor [″]")
    return Table("What the drives contribute and what the floor does", columns, cells)
