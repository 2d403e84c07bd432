"""How every picture looks: colours, line weights, and the units a person reads.

Nothing here touches a global setting or a window: a picture is a `Figure` of its own, drawn under a
temporary style, so that it works without a screen and leaves a caller's own style alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

from dualdrive.readable import Scale, scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "BAND",
    "COMMAND",
    "FIRST",
    "LIMIT",
    "MEASURED",
    "MODEL",
    "NOISE",
    "PAPER",
    "SECOND",
    "TABLE",
    "Scale",
    "drive_colour",
    "figure_of",
    "new_axes",
    "picture",
    "scale",
    "single",
]

P = ParamSpec("P")
R = TypeVar("R")

# Okabe and Ito's palette: told apart by every kind of colour vision.
FIRST: Final = "#0072B2"
SECOND: Final = "#D55E00"
TABLE: Final = "#009E73"
_FURTHER: Final = ("#CC79A7", "#56B4E9", "#E69F00", "#8C6D31", "#666666")

COMMAND: Final = "#555555"
MEASURED: Final = "#1A1A1A"
MODEL: Final = SECOND
LIMIT: Final = "#999999"
BAND: Final = "#E3E7EA"
NOISE: Final = "#B9BEC2"
PAPER: Final = "#FFFFFF"

_STYLE: Final[dict[str, Any]] = {
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "figure.dpi": 110,
    "savefig.dpi": 150,
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#444444",
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.xmargin": 0.0,
    "grid.color": "#D9DCDE",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.2,
    "agg.path.chunksize": 20000,
}


def picture(draw: Callable[P, R]) -> Callable[P, R]:
    """Draw under the house style, whatever the caller's own settings are."""

    @wraps(draw)
    def styled(*args: P.args, **kwargs: P.kwargs) -> R:
        from matplotlib import rc_context

        with rc_context(_STYLE):  # type: ignore[arg-type]
            return draw(*args, **kwargs)

    return styled


def drive_colour(number: int) -> str:
    """The colour of a drive, the same in every picture; `number` counts from 1."""
    colours = (FIRST, SECOND, *_FURTHER)
    return colours[(number - 1) % len(colours)]


def single(axes: Axes | None, width: float = 8.0, height: float = 3.4) -> Axes:
    """The axes to draw in: the caller's, or those of a new figure (inches)."""
    if axes is not None:
        return axes
    return new_axes(1, width, height)[0]


def new_axes(
    rows: int, width: float, height: float, ratios: Sequence[float] | None = None
) -> list[Axes]:
    """Panels below each other with one common x axis."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=ratios)
    panels = [row[0] for row in grid]
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    return panels


def figure_of(axes: Axes) -> Figure:
    """The whole figure that axes belong to."""
    from matplotlib.figure import Figure

    figure = axes.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure
