"""docs/paper.md as the command writes it: every exhibit with its picture and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dualdrive.paper.exhibit import Exhibit, Table, shown

__all__ = ["page", "section"]

_INTRODUCTION = """\
# The paper's figures and tables, side by side

Written by `{command}`; nothing here is typed by hand.

The paper: *Elimination of Gear Clearance for the Rotary Table of Ultra Heavy Duty Vertical Milling
Lathe Based on Dual Servo Motor Driving System*. All is from the paper's text: its pictures are not
at hand, and what they show beyond captions and sentences is not known here. It prints no parameter
of its machine: each section says what was chosen.
Equations and errata: [theory/paper.md](theory/paper.md).
"""


def page(exhibits: Sequence[Exhibit], pictures: Mapping[str, str], command: str) -> str:
    """The whole page in Markdown. pictures: exhibit -> path as the page links it."""
    sections = [section(exhibit, pictures.get(exhibit.name)) for exhibit in exhibits]
    return "\n".join([_INTRODUCTION.format(command=command), _overview(exhibits), *sections])


def section(exhibit: Exhibit, picture: str | None = None) -> str:
    """One exhibit in Markdown, without the time it took, so that it comes out the same again."""
    parts = [f"## {exhibit.title}", exhibit.about]
    if picture:
        parts.append(f"![{exhibit.title}]({picture})")
    parts.append("Chosen:\n\n" + _bullets(exhibit.chosen))
    parts += [markdown(sheet) for sheet in exhibit.sheets()]
    if exhibit.notes:
        parts.append(_bullets(exhibit.notes))
    return "\n\n".join(parts) + "\n"


def markdown(table: Table) -> str:
    """A table in Markdown, its title above it."""
    lines = [_row(table.columns), _row(["---"] * len(table.columns))]
    lines += [_row([shown(cell) for cell in row]) for row in table.rows]
    text = "\n".join(lines)
    return f"**{table.title}**\n\n{text}" if table.title else text


def _overview(exhibits: Sequence[Exhibit]) -> str:
    """One line per exhibit: its largest deviation, its claims that hold."""
    rows = []
    for exhibit in exhibits:
        deviations = [abs(n.deviation) for n in exhibit.numbers if n.deviation is not None]
        verdicts = [claim.holds for claim in exhibit.claims]
        count = "; ".join(
            f"{verdicts.count(kind)} {kind}"
            for kind in ("yes", "in part", "no")
            if kind in verdicts
        )
        fitted = f", {exhibit.fitted} gains fitted to them" if exhibit.fitted else ""
        largest = (
            f"{100 * max(deviations):.1f} % of {len(deviations)}{fitted}" if deviations else None
        )
        rows.append((exhibit.title, largest, count or None))
    columns = ("", "largest deviation from printed numbers", "claims in words that hold")
    return markdown(Table("", columns, tuple(rows))) + "\n"


def _bullets(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
