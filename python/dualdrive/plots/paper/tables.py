"""Tables 1 and 2: printed and found figures side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dualdrive.plots.style import FIRST, LIMIT, MEASURED, TABLE, picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dualdrive.paper.tables import Tables

__all__ = ["accuracy"]


@picture
def accuracy(data: Tables) -> Figure:
    """Bars of each row of the table: printed, drive model alone, with the floor."""
    from matplotlib.figure import Figure as Sheet

    rows = [row for row in data.rows if row.printed is not None]
    sheet = Sheet(figsize=(8.0, 0.7 * len(rows) + 1.2), layout="constrained")
    axes = sheet.subplots()
    places = np.arange(len(rows))[::-1]
    columns = (("printed", "printed", MEASURED), ("alone", "drive model alone", FIRST),
               ("with_floor", "with floor", TABLE))  # fmt: skip
    for k, (field, label, colour) in enumerate(columns):
        values = [getattr(row, field) for row in rows]
        bars = axes.barh(places + 0.26 * (1 - k), [v or 0.0 for v in values], 0.24, color=colour,
                         label=label)  # fmt: skip
        axes.bar_label(bars, ["–" if v is None else f"{v:.2f}" for v in values], padding=3,
                       fontsize=8)  # fmt: skip
    names = [f"{row.column}\n{row.figure}, {row.load.replace('t', ' t')}" if row.load != "empty"
             else f"{row.column}\n{row.figure}" for row in rows]  # fmt: skip
    axes.set_yticks(places, names)
    axes.set_xlabel("indexing accuracy [arcsec]")
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_color(LIMIT)
    axes.legend(loc="lower right")
    return sheet
