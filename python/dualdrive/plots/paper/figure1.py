"""Figure 1: drive trains seen from above: motors, reducers, pinions on the ring, the encoder."""

from __future__ import annotations

import re
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

from dualdrive.plots.style import COMMAND, PAPER, SECOND, TABLE, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.paper.figure1 import Chain, Figure1, Train

__all__ = ["transmission"]

_RING: Final = 1.0
_PINION: Final = 0.16
_TITLE: Final = 44  # letters in a line
_STEEL, _MOTOR, _PLAY = "#E2F1EC", "#E4EEF5", "#F6E3D5"


@picture
def transmission(data: Figure1) -> Figure:
    """A train beside the other."""
    from matplotlib.figure import Figure as Sheet

    sheet = Sheet(figsize=(9.0, 6.6), layout="constrained")
    for axes, train in zip(sheet.subplots(1, len(data.trains), squeeze=False)[0], data.trains,
                           strict=True):  # fmt: skip
        _train(axes, train)
    return sheet


def _train(axes: Axes, train: Train) -> None:
    from matplotlib.patches import Circle

    axes.set(xlim=(-1.75, 1.75), ylim=(-3.15, 1.35), aspect="equal")
    axes.set_axis_off()
    drives, _, _ = train.title.rpartition(",")  # without the load
    axes.set_title(fill(drives, _TITLE), fontsize=9)
    axes.add_patch(Circle((0, 0.25), _RING, fc=PAPER, ec=COMMAND, lw=1.2))
    axes.add_patch(Circle((0, 0.25), _RING - 0.06, fc="none", ec=COMMAND, lw=0.8, ls=":"))
    axes.text(0, 0.62, "table with ring", ha="center", fontsize=9)
    if "table" in train.sensors:
        axes.add_patch(Circle((0, 0.25), 0.2, fc=_STEEL, ec=TABLE, lw=1.4))
        axes.text(0, -0.08, "circular grating,\nposition loop", ha="center", va="top", fontsize=8,
                  color=TABLE)  # fmt: skip
    for chain, x in zip(train.chains, (-0.82, 0.82), strict=False):
        _chain(axes, chain, x, "motor" in train.sensors)
    if train.shaft is not None:
        y = -0.52
        axes.plot([-0.82 + _PINION, 0.82 - _PINION], [y, y], color=SECOND, lw=1.6, ls=(0, (2, 1)))
        shaft = f"split shaft:\n{_words(train.shaft.text)}"
        axes.text(0, 0.22 - _RING, shaft, ha="center", va="top", fontsize=7.5, color=SECOND)


def _chain(axes: Axes, chain: Chain, x: float, sensed: bool) -> None:
    from matplotlib.patches import Circle

    pinion = -0.52
    axes.add_patch(Circle((x, pinion), _PINION, fc=_STEEL, ec=COMMAND, lw=1.2))
    side = "left" if x > 0 else "right"
    shift = 0.2 if x > 0 else -0.2
    colour = SECOND if chain.mesh.kind == "gap" else COMMAND
    mesh = f"mesh {chain.number}:\n{_words(chain.mesh.text)}"
    axes.text(x + shift, pinion + 0.28, mesh, ha=side, va="center", fontsize=7.5, color=colour)
    axes.text(x + shift, pinion, f"pinion {chain.number}", ha=side, va="center", fontsize=8)
    if chain.motor is None:
        return
    axes.plot([x, x], [pinion - _PINION, -1.17], color=COMMAND, lw=2)
    if chain.reducer is not None:
        colour = _PLAY if chain.reducer.kind == "gap" else _STEEL
        _box(axes, x, -1.55, f"reducer {chain.number}\n{_words(chain.reducer.text)}", colour)
    axes.plot([x, x], [-1.93, -2.32], color=COMMAND, lw=2)
    more = "\nencoder: position loop" if sensed and chain.number == 1 else ""
    _box(axes, x, -2.7, f"D{chain.number}\n{chain.motor}{more}", _MOTOR)


def _box(axes: Axes, x: float, y: float, text: str, fill: str) -> None:
    from matplotlib.patches import FancyBboxPatch

    look: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.05", "fc": fill, "ec": COMMAND}
    axes.add_patch(FancyBboxPatch((x - 0.62, y - 0.38), 1.24, 0.76, **look))
    axes.text(x, y, text, ha="center", va="center", fontsize=7.5)


def _words(text: str) -> str:
    lines = text.replace(", ", "\n")
    return re.sub(r"\bi_m\b", r"$i_m$", lines)
