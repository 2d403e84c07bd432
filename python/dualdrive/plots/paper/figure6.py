"""Figure 6: torques of master and slave in three states of tuning."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dualdrive.plots.record import View
from dualdrive.plots.style import picture
from dualdrive.plots.timeline import SECONDS, draw_torques

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dualdrive.paper.figure6 import Figure6

__all__ = ["tension"]

_SHOWN = (1.0, 8.0)


@picture
def tension(data: Figure6) -> Figure:
    """One panel per state, the torque scale common to all."""
    from matplotlib.figure import Figure as Sheet

    sheet = Sheet(figsize=(9.0, 2.9 * len(data.runs)), layout="constrained")
    panels = sheet.subplots(len(data.runs), 1, sharex=True, sharey=True)
    for letter, axes, (name, run) in zip("abcdef", panels, data.runs.items(), strict=False):
        draw_torques(axes, View(run, _SHOWN), SECONDS, marks=False)
        axes.set_title(f"({letter}) {name}")
    panels[-1].set_xlabel("time [s]")
    return sheet
