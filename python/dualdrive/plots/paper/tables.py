"""Tables 1 and 2: A, R and B against the delay of the reading, the printed numbers as marks."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from dualdrive.plots.style import COMMAND, FIRST, SECOND, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.paper.tables import Tables

__all__ = ["accuracy"]

_COLOURS = {"traditional": FIRST, "double motors": SECOND}
_TITLE = 24  # letters in a line
_LINES = {"table": "-", "motor": "--"}


@picture
def accuracy(data: Tables) -> Figure:
    """A row per load, a column per figure; medians, and bands from the least to the most."""
    from matplotlib.figure import Figure as Sheet

    from dualdrive.paper.tables import WORDS, load_text

    rows = len(data.loads)
    sheet = Sheet(figsize=(9.0, 1.0 + 2.7 * rows), layout="constrained")
    panels = sheet.subplots(rows, 3, sharex=True, sharey=True, squeeze=False)
    for load, row in zip(data.loads, panels, strict=True):
        for figure, axes in zip("ARB", row, strict=True):
            _panel(axes, data, load, figure)
        row[0].set_ylabel(f"{load_text(load)}\narc seconds")
    for figure, axes in zip("ARB", panels[0], strict=True):
        axes.set_title(fill(WORDS[figure], _TITLE))
    for axes in panels[-1]:
        axes.set_xlabel("in position to reading [s]")
    handles, labels = panels[0][0].get_legend_handles_labels()
    sheet.legend(handles, labels, loc="outside upper center", ncols=4, fontsize=8)
    return sheet


def _panel(axes: Axes, data: Tables, load: str, figure: str) -> None:
    from dualdrive.indexing import DEMANDED, PRINTED, TOLERANCE
    from dualdrive.paper.tables import SHOWN

    gap, grade = SHOWN
    cells = [c for c in data.result.cells() if (c.load, c.gap, c.grade) == (load, gap, grade)]
    for column, colour in _COLOURS.items():
        for sensor, line in _LINES.items():
            own = [c for c in cells if c.sensor == sensor]
            x = [c.reading for c in own]
            values = [data.result.values(c, column, figure) for c in own]
            known = [v[~np.isnan(v)] for v in values]
            low, middle, high = (
                [float(np.quantile(v, q)) if v.size else np.nan for v in known]
                for q in (0.0, 0.5, 1.0)
            )
            axes.fill_between(x, low, high, color=colour, alpha=0.15, lw=0)
            axes.plot(x, middle, line, color=colour, label=f"{column}, {sensor}'s encoder")
        printed = PRINTED[load, column].get(figure)
        if printed is not None:
            axes.plot([0.42], [printed], ">", color=colour, ms=8, mec=COMMAND, clip_on=False,
                      zorder=5, ls="none", label=f"printed, {column}")  # fmt: skip
    axes.axhline(TOLERANCE[figure], color=COMMAND, lw=0.8, ls=":", label="tolerance of Table 1")
    if figure == "A":
        axes.axhline(2 * DEMANDED, color=COMMAND, lw=0.8, ls="-.", label="± 4″ demanded")
    axes.set(xscale="log", yscale="log", xlim=(0.4, 6.0))
    axes.set_xticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
    axes.set_yticks([0.5, 1, 2, 5, 10, 20, 50], ["0.5", "1", "2", "5", "10", "20", "50"])
    axes.minorticks_off()
