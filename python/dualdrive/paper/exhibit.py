"""A figure or table of the paper as it becomes here: chosen, printed, found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

__all__ = ["Claim", "Exhibit", "Number", "Table", "shown", "verdict"]

Verdict = Literal["yes", "in part", "no"]


@dataclass(frozen=True)
class Number:
    """A number that the paper prints beside the one that is found here.

    what, unit: as both are given
    printed:    of the paper
    found:      here; None where the run has no such number (it never settles, say)
    reason:     why the two differ, or why they may not be compared
    """

    what: str
    unit: str
    printed: float
    found: float | None
    reason: str = ""

    @property
    def deviation(self) -> float | None:
        """Found over printed, less one; None where nothing is found."""
        return None if self.found is None else self.found / self.printed - 1.0


@dataclass(frozen=True)
class Claim:
    """What the paper says of a figure in words, what is found here, and whether it holds."""

    printed: str
    found: str
    holds: Verdict


@dataclass(frozen=True)
class Table:
    """Further numbers: rows as wide as `columns`; a cell is a number, words, or None."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[float | str | None, ...], ...]


@dataclass(frozen=True)
class Exhibit:
    """One figure or table of the paper, reproduced.

    name:    fig1 ... fig6, table1, table2
    title:   one line
    about:   what the paper shows, and what is computed here
    chosen:  what the paper leaves open and was chosen
    fitted:  how many numbers of the model were fitted to the printed ones
    notes:   what a reader must know besides
    data:    what the picture is drawn from, a type of each figure's own
    seconds: how long it took
    """

    name: str
    title: str
    about: str
    chosen: tuple[str, ...]
    numbers: tuple[Number, ...] = ()
    fitted: int = 0
    claims: tuple[Claim, ...] = ()
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()
    data: Any = field(default=None, repr=False)
    seconds: float = 0.0

    def sheets(self) -> list[Table]:
        """Everything that is tabulated, as it is printed: printed numbers first, claims next."""
        sheets = []
        if self.numbers:
            columns = ("", "printed", "here", "deviation", "reason")
            sheets.append(Table("", columns, tuple(_number_row(n) for n in self.numbers)))
        if self.claims:
            rows = tuple((c.printed, c.found, c.holds) for c in self.claims)
            sheets.append(Table("", ("the paper says", "here", "holds"), rows))
        return [*sheets, *self.tables]

    def _repr_html_(self) -> str:
        import dualdrive  # its lazy name: how a notebook shows things knows of results

        return dualdrive.notebook.exhibit(self)

    def to_dict(self) -> dict[str, Any]:
        """Everything but `data`, for JSON."""
        numbers = [
            {
                "what": n.what,
                "unit": n.unit,
                "printed": n.printed,
                "found": n.found,
                "deviation": n.deviation,
                "reason": n.reason,
            }
            for n in self.numbers
        ]
        return {
            "name": self.name,
            "title": self.title,
            "about": self.about,
            "chosen": list(self.chosen),
            "fitted": self.fitted,
            "numbers": numbers,
            "claims": [vars(claim) for claim in self.claims],
            "tables": [
                {"title": t.title, "columns": list(t.columns), "rows": [list(r) for r in t.rows]}
                for t in self.tables
            ],
            "notes": list(self.notes),
            "seconds": self.seconds,
        }


def verdict(*conditions: bool) -> Verdict:
    """Yes where all hold, no where none does."""
    held = sum(conditions)
    return "yes" if held == len(conditions) else "in part" if held else "no"


def shown(cell: float | str | None) -> str:
    """A cell as it is printed: four digits, a dash where there is nothing."""
    if cell is None:
        return "–"
    return cell if isinstance(cell, str) else f"{cell + 0.0:.4g}"


def _number_row(n: Number) -> tuple[float | str | None, ...]:
    deviation = None if n.deviation is None else f"{round(100 * n.deviation, 1) + 0.0:+.1f} %"
    what = f"{n.what} [{n.unit}]" if n.unit else n.what
    return (what, n.printed, n.found, deviation, n.reason)
