"""Flanks in a picture: the band of the play, a strip of which flank carries, marks of changes."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from dualdrive.plots.record import View
from dualdrive.plots.style import BAND, LIMIT, TABLE, Scale, drive_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["change_marks", "play_band", "strip"]

#: flank -> (name, colour): the gap pale, the flanks apart in hue and in lightness
_LOOK: Final = {1: ("front flank", TABLE), 0: ("in the gap", BAND), -1: ("back flank", "#7B4B94")}


def strip(axes: Axes, view: View, time: Scale, origin: float = 0.0) -> None:
    """One bar per mesh over time, coloured by the flank that carries."""
    meshes = view.meshes()
    edges = time(np.append(view.t, view.t[-1]) - origin)
    for row, n in enumerate(meshes):
        flank = np.sign(view[f"mesh_{n}.flank"])
        starts = np.concatenate([[0], np.flatnonzero(np.diff(flank)) + 1, [len(flank)]])
        for side, (_, colour) in _LOOK.items():
            bars = [
                (edges[a], edges[b] - edges[a]) for a, b in pairwise(starts) if flank[a] == side
            ]
            axes.broken_barh(bars, (row - 0.4, 0.8), facecolors=colour, linewidth=0)
    axes.set_yticks(range(len(meshes)), [f"mesh {n}" for n in meshes])
    axes.set_ylim(len(meshes) - 0.4, -0.6)
    axes.grid(visible=False)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    _key(axes)


def _key(axes: Axes) -> None:
    from matplotlib.patches import Patch

    patches = [Patch(facecolor=colour, label=name) for name, colour in _LOOK.values()]
    axes.legend(handles=patches, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0)


def play_band(axes: Axes, half_gap: float, deflection: Scale) -> None:
    """The band ±Δ in which no flank touches, with its edges."""
    edge = float(deflection(half_gap))
    label = f"play ±Δ, Δ = {edge:.3g} {deflection.unit}"
    axes.axhspan(-edge, edge, color=BAND, lw=0, zorder=0, label=label)
    for side in (-1, 1):
        axes.axhline(side * edge, color=LIMIT, lw=0.8, zorder=1)


def change_marks(axes: Axes, view: View, time: Scale, origin: float = 0.0) -> None:
    """Ticks above the lines where a flank begins or ceases to carry, a row per mesh."""
    changes = {
        n: [e.t for e in view.events(f"mesh_{n}") if _carries(e.from_) != _carries(e.to)]
        for n in view.meshes()
    }
    changes = {n: times for n, times in changes.items() if times}
    if not changes:
        return
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.06 * len(changes) * (high - low))
    for row, (n, times) in enumerate(changes.items()):
        top = 1.0 - 0.05 * row
        axes.vlines(
            time(np.array(times) - origin),
            top - 0.04,
            top,
            transform=axes.get_xaxis_transform(),
            colors=drive_colour(n),
            linewidth=1.0,
            label="flank changes" if row == 0 else "_",
        )


def _carries(mode: str) -> bool:
    return mode in ("front", "back")
