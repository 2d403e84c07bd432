"""Figure 3: blocks and arrows of a control structure, from top to bottom of an upright page.

`dualdrive.paper.structure` places blocks along the flow (x) and across it (y); here the flow runs
downwards, so that both drives stand side by side and texts stay legible at the width of a page.
"""

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

Point = tuple[float, float]

#: inches per unit along the flow and across it
_ALONG, _ACROSS = 0.80, 1.22
#: half a block's size along and across
_HALF: Final = {"sum": (0.14, 0.1), "body": (0.3, 0.48)}
_BOX: Final = (0.46, 0.52)
_LOOKS: Final = {"equaliser": (0.5, 0.72), "tension": (0.4, 0.5)}
_FILL: Final = {"gap": "#F6E3D5", "delay": "#E4EEF5", "limit": BAND, "body": "#E2F1EC"}
_TEXT: Final = 9.0


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
    top, bottom = min(xs) - 0.9, max(xs) + 0.75
    left, right = -max(ys) - 0.75, -min(ys) + 0.75
    sheet = Sheet(figsize=((right - left) * _ACROSS, (bottom - top) * _ALONG))
    axes = sheet.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(left, right), ylim=(-bottom, -top))
    axes.set_axis_off()
    axes.text(left + 0.1, -top - 0.25, shown.title, fontweight="bold", va="center")
    for arrow in shown.arrows:
        _arrow(axes, shown[arrow.source], shown[arrow.target], arrow)
    for block in shown.blocks:
        _block(axes, block)
    return sheet


def _at(point: Point) -> Point:
    """A place along and across the flow as it stands on the page: drive 1 to the left."""
    return -point[1], -point[0]


def _half(block: Block) -> Point:
    return _LOOKS.get(block.name) or _HALF.get(block.shape, _BOX)


def _block(axes: Axes, block: Block) -> None:
    from matplotlib.patches import Ellipse, FancyBboxPatch

    (along, across), (x, y) = _half(block), _at((block.x, block.y))
    look: dict[str, Any] = {"ec": COMMAND, "lw": 1.0, "zorder": 3}
    if block.shape == "sum":
        axes.add_patch(Ellipse((x, y), 2 * across, 2 * along, fc=PAPER, **look))
        return
    round_ = "round,pad=0,rounding_size=0.08" if block.shape == "body" else "square,pad=0"
    fill = _FILL.get(block.shape, PAPER)
    corner = (x - across, y - along)
    axes.add_patch(FancyBboxPatch(corner, 2 * across, 2 * along, boxstyle=round_, fc=fill, **look))
    axes.text(x, y, _typeset(block.text), ha="center", va="center", fontsize=_TEXT,
              linespacing=1.2, zorder=4)  # fmt: skip
    if block.shape in ("gap", "limit"):
        inwards = -1.0 if block.y < 0.0 else 1.0  # where nothing runs beside the drive
        _characteristic(axes, block, x + inwards * (across + 0.3), y)


def _characteristic(axes: Axes, block: Block, x: float, y: float) -> None:
    """The bent line of a dead zone or a limit, beside its block."""
    rise = 0.14
    flat, steep = ((0.0, 0.0), rise) if block.shape == "gap" else ((-rise, rise), 0.0)
    xs = [x + d for d in (-0.24, -0.09, 0.09, 0.24)]
    ys = [y + d for d in (flat[0] - steep, flat[0], flat[1], flat[1] + steep)]
    axes.plot(xs, ys, color=SECOND if block.shape == "gap" else COMMAND, lw=1.4)


def _arrow(axes: Axes, source: Block, target: Block, arrow: Arrow) -> None:
    points = [_at(point) for point in _route(source, target, arrow.at)]
    colour = {"table": TABLE, "tension": FIRST, "equaliser": FIRST}.get(source.name, COMMAND)
    if target.name == "equaliser":
        colour = FIRST
    if len(points) > 2:
        xs, ys = zip(*points[:-1], strict=True)
        axes.plot(xs, ys, color=colour, lw=1.0, zorder=2, solid_joinstyle="miter")
    head: Any = {"arrowstyle": "-|>", "color": colour, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", points[-1], points[-2], arrowprops=head, zorder=2)
    _texts(axes, points, arrow, colour)


def _texts(axes: Axes, points: list[Point], arrow: Arrow, colour: str) -> None:
    """The signal's name beside the longest stretch, its sign beside the arrow's head."""
    if arrow.text:
        (x0, y0), (x1, y1) = max(
            pairwise(points), key=lambda s: abs(s[0][0] - s[1][0]) + abs(s[0][1] - s[1][1])
        )
        upright = abs(x1 - x0) < 1e-9
        detour = arrow.at is not None and upright
        place: Any = {"ha": "center", "va": "center" if detour else "bottom"}
        off = (0.0, 0.0) if detour else (0.0, 0.05)
        if upright and not detour:
            place, off = {"ha": "left", "va": "center"}, (0.05, 0.0)
        axes.text((x0 + x1) / 2 + off[0], (y0 + y1) / 2 + off[1], _typeset(arrow.text),
                  fontsize=_TEXT, color=colour, rotation=90 if detour else 0,
                  bbox={"fc": PAPER, "ec": "none", "pad": 0.6} if detour else None,
                  zorder=5, **place)  # fmt: skip
    if arrow.sign:
        (x0, y0), (x1, y1) = points[-2:]
        across = abs(x1 - x0) > abs(y1 - y0)
        away = (-0.1 if x1 > x0 else 0.1, 0.14) if across else (0.1, 0.14 if y0 > y1 else -0.14)
        axes.text(x1 + away[0], y1 + away[1], arrow.sign, ha="center", va="center",
                  fontsize=_TEXT + 1, color=colour)  # fmt: skip


# --- ways, along and across the flow --------------------------------------------------------------


def _route(s: Block, t: Block, at: float | None) -> list[Point]:
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
    if s.name == "equaliser":  # out at its side, between it and the drive
        beside = s.y + way * (sh + 0.13)
        return [
            (s.x - 0.3, s.y + way * sh),
            (s.x - 0.3, beside),
            (t.x, beside),
            (t.x, t.y - way * th),
        ]
    if t.name in ("table", "command"):
        return [(s.x + sw, s.y), (t.x, s.y), (t.x, t.y - way * th)]
    elbow = s.x + sw + 0.12
    return [(s.x + sw, s.y), (elbow, s.y), (elbow, t.y), (t.x - tw, t.y)]


def _detour(s: Block, t: Block, at: float) -> list[Point]:
    """Along the row `at`: behind the table, or straight out of and into the other blocks."""
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
