"""Figure 3: blocks and arrows of a control structure."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from dualdrive.plots.style import BAND, COMMAND, FIRST, PAPER, SECOND, TABLE, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.paper.figure3 import Figure3
    from dualdrive.paper.structure import Arrow, Block, Diagram

__all__ = ["diagram", "structure"]

#: inches per column and row; half a block's width and height, in columns and rows
_COLUMN, _ROW = 0.83, 0.83
_HALF: Final = {"sum": (0.13, 0.14), "body": (0.46, 0.3)}
_BOX: Final = (0.52, 0.5)
_FILL: Final = {"gap": "#F6E3D5", "delay": "#E4EEF5", "limit": BAND, "body": "#E2F1EC"}


@picture
def structure(data: Figure3) -> Figure:
    """The diagram of the exhibit's machine."""
    return diagram(data.diagram)


@picture
def diagram(shown: Diagram) -> Figure:
    """Any machine's diagram from `dualdrive.paper.structure.structure`."""
    from matplotlib.figure import Figure as Sheet

    xs = [block.x for block in shown.blocks]
    ys = [block.y for block in shown.blocks] + [a.at for a in shown.arrows if a.at is not None]
    left, right, low, high = min(xs) - 0.7, max(xs) + 0.85, min(ys) - 0.5, max(ys) + 1.15
    sheet = Sheet(figsize=((right - left) * _COLUMN, (high - low) * _ROW))
    axes = sheet.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(left, right), ylim=(low, high))
    axes.set_axis_off()
    axes.text(left + 0.2, high - 0.25, shown.title, fontweight="bold", va="center")
    for arrow in shown.arrows:
        _arrow(axes, shown[arrow.source], shown[arrow.target], arrow)
    for block in shown.blocks:
        _block(axes, block)
    return sheet


def _half(block: Block) -> tuple[float, float]:
    if block.name == "equaliser":
        return (1.05, 0.55)
    return _HALF.get(block.shape, _BOX)


def _block(axes: Axes, block: Block) -> None:
    from matplotlib.patches import Ellipse, FancyBboxPatch

    width, height = _half(block)
    look: dict[str, Any] = {"ec": COMMAND, "lw": 1.0, "zorder": 3}
    if block.shape == "sum":
        axes.add_patch(Ellipse((block.x, block.y), 2 * width, 2 * height, fc=PAPER, **look))
        return
    corner = (block.x - width, block.y - height)
    round_ = "round,pad=0,rounding_size=0.08" if block.shape == "body" else "square,pad=0"
    fill = _FILL.get(block.shape, PAPER)
    axes.add_patch(FancyBboxPatch(corner, 2 * width, 2 * height, boxstyle=round_, fc=fill, **look))
    axes.text(block.x, block.y, _typeset(block.text), ha="center", va="center", fontsize=8,
              linespacing=1.25, zorder=4)  # fmt: skip
    if block.shape in ("gap", "limit"):
        _characteristic(axes, block)


def _characteristic(axes: Axes, block: Block) -> None:
    """The bent line of a dead zone or a limit, above its block."""
    rise = 0.12
    flat, steep = ((0.0, 0.0), rise) if block.shape == "gap" else ((-rise, rise), 0.0)
    x = [block.x + d for d in (-0.34, -0.12, 0.12, 0.34)]
    middle = block.y + _half(block)[1] + 0.22
    y = [middle + d for d in (flat[0] - steep, flat[0], flat[1], flat[1] + steep)]
    axes.plot(x, y, color=SECOND if block.shape == "gap" else COMMAND, lw=1.3)


def _arrow(axes: Axes, source: Block, target: Block, arrow: Arrow) -> None:
    points = _route(source, target, arrow.at)
    colour = {"table": TABLE, "tension": FIRST, "equaliser": FIRST}.get(source.name, COMMAND)
    if target.name == "equaliser":
        colour = FIRST
    if len(points) > 2:
        xs, ys = zip(*points[:-1], strict=True)
        axes.plot(xs, ys, color=colour, lw=1.0, zorder=2, solid_joinstyle="miter")
    head: Any = {"arrowstyle": "-|>", "color": colour, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", points[-1], points[-2], arrowprops=head, zorder=2)
    _texts(axes, points, arrow, colour)


def _texts(axes: Axes, points: list[tuple[float, float]], arrow: Arrow, colour: str) -> None:
    """The signal's name beside the longest stretch, its sign beside the arrow's head."""
    if arrow.text:
        stretches = pairwise(points)
        (x0, y0), (x1, y1) = max(stretches, key=lambda s: abs(s[0][0] - s[1][0]))
        upright = abs(x1 - x0) < 1e-9
        place: Any = {"ha": "left", "va": "center"} if upright else {"ha": "center", "va": "bottom"}
        off = (0.08, 0.0) if upright else (0.0, 0.06)
        axes.text((x0 + x1) / 2 + off[0], (y0 + y1) / 2 + off[1], _typeset(arrow.text), fontsize=8,
                  color=colour, **place)  # fmt: skip
    if arrow.sign:
        (x0, y0), (x1, y1) = points[-2:]
        across = abs(x1 - x0) > abs(y1 - y0)
        away = (-0.12 if x1 > x0 else 0.12, 0.13) if across else (0.12, -0.14 if y1 > y0 else 0.14)
        axes.text(x1 + away[0], y1 + away[1], arrow.sign, ha="center", va="center", fontsize=9,
                  color=colour)  # fmt: skip


def _route(s: Block, t: Block, at: float | None) -> list[tuple[float, float]]:
    """The corners of an arrow's way, at right angles."""
    (sw, sh), (tw, th) = _half(s), _half(t)
    if at is not None:
        return _detour(s, t, at)
    if abs(s.y - t.y) < 1e-9:
        side = 1 if t.x > s.x else -1
        return [(s.x + side * sw, s.y), (t.x - side * tw, t.y)]
    way = 1 if t.y > s.y else -1
    if abs(t.x - s.x) <= sw:
        return [(t.x, s.y + way * sh), (t.x, t.y - way * th)]
    if s.shape == "body" and s.name == "reference":
        return [(s.x, s.y + way * sh), (s.x, t.y), (t.x - tw, t.y)]
    if t.name in ("table", "command"):
        return [(s.x + sw, s.y), (t.x, s.y), (t.x, t.y - way * th)]
    elbow = s.x + sw + 0.12
    return [(s.x + sw, s.y), (elbow, s.y), (elbow, t.y), (t.x - tw, t.y)]


def _detour(s: Block, t: Block, at: float) -> list[tuple[float, float]]:
    """Along the row `at`: behind the table, or straight up and down from the other blocks."""
    (sw, sh), (tw, th) = _half(s), _half(t)
    if s.name == "table":
        out = s.x + sw + 0.2
        begin = [(s.x + sw, s.y), (out, s.y), (out, at)]
    else:
        begin = [(s.x, s.y + (sh if at > s.y else -sh)), (s.x, at)]
    if abs(at - t.y) < th:  # it comes in at the side
        return [*begin, (t.x + (tw if s.x > t.x else -tw), at)]
    return [*begin, (t.x, at), (t.x, t.y + (th if at > t.y else -th))]


def _typeset(text: str) -> str:
    """K_v with its index below, T_1* with its star above."""
    text = re.sub(r"(\w)_(\w+)\*", r"$\1_{\\mathrm{\2}}^*$", text)
    return re.sub(r"(?<![\w$])(\w)_(\w+)(?![\w}])", r"$\1_{\\mathrm{\2}}$", text)
