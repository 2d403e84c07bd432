"""Figure 6: torques of master and slave before and after tuning."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dualdrive.plots.record import View
from dualdrive.plots.style import picture
from dualdrive.plots.timeline import SECONDS, draw_torques

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dualdrive.paper.figure6 import Figure6

__all__ = ["tension"]

_WORDS = (
    "M1: motor 1, master; M2: motor 2, slave.\n"
    "In (a) both swing over the same band, one against the other"
)
_SHOWN, _CLOSE = (1.0, 8.0), (12.0, 12.1)  # s


@picture
def tension(data: Figure6) -> Figure:
    """One row per state, the torque scale common to all: the move, and a moment of rest."""
    from matplotlib.figure import Figure as Sheet

    sheet = Sheet(figsize=(9.0, 3.1 * len(data.runs)), layout="constrained")
    sheet.suptitle(_WORDS, x=0.02, ha="left", fontsize=9)
    panels = sheet.subplots(len(data.runs), 2, sharey=True, width_ratios=(2, 1))
    for letter, row, (name, run) in zip("abcdef", panels, data.runs.items(), strict=False):
        for axes, window in zip(row, (_SHOWN, _CLOSE), strict=True):
            draw_torques(axes, View(run, window), SECONDS, marks=False, name="M")
            axes.get_legend().remove()
        row[0].set_title(f"({letter}) {name}")
        row[1].set_title("at rest")
    for line in panels[0][0].lines[:2]:  # a vibration fills its band: let the other shine through
        line.set(alpha=0.6, lw=0.8)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    for axes in panels[:, 1]:
        axes.set_xticks(np.linspace(*_CLOSE, 6)[1:])
    handles, labels = panels[0][0].get_legend_handles_labels()
    key = sheet.legend(handles, labels, loc="outside upper right", ncols=3)
    for handle in key.get_lines():
        handle.set(alpha=1.0)
    return sheet
