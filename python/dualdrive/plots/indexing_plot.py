"""The chart of a positioning test: deviation over target, both directions, mean and spread."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.style import COMMAND, FIRST, SECOND, Scale, figure_of, picture, scale, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.indexing import Iso230

__all__ = ["indexing"]

_MOST_TICKS = 12
_SIDES = ((FIRST, ">", "upwards"), (SECOND, "<", "downwards"))


@picture
def indexing(result: Iso230, axes: Axes | None = None) -> Figure:
    """Deviation against target as ISO 230-2 draws it: approaches, means, bands of ± 2 s.

    Where one approach was made there is no band. A note below gives the figures.
    """
    axes = single(axes, height=4.2)
    deviation = scale(result.unit, np.concatenate([side.ravel() for side in result.sides()]))
    along = scale(result.unit, result.targets, prefer={"rad": "deg", "m": "mm"}.get(result.unit))
    for side, (colour, marker, way) in zip(result.sides(), _SIDES, strict=False):
        _side(
            axes, along(result.targets), deviation, side, result.spread(side), colour, marker, way
        )
    _mean(axes, along(result.targets), deviation, result)
    axes.axhline(0.0, color=COMMAND, lw=0.8, zorder=1)
    axes.margins(0.04, 0.12)
    if result.targets.size <= _MOST_TICKS:
        axes.set_xticks(along(result.targets))
    axes.set_xlabel(along.label("target"))
    axes.set_ylabel(deviation.label("deviation"))
    axes.set_title(f"Positioning test of {result.name or 'an axis'}")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.28), ncols=3)
    axes.annotate(
        _figures(result, deviation),
        (0.5, -0.2),
        xycoords="axes fraction",
        ha="center",
        va="top",
        fontsize=9,
    )
    return figure_of(axes)


def _side(
    axes: Axes,
    targets: NDArray[np.float64],
    deviation: Scale,
    side: NDArray[np.float64],
    spread: NDArray[np.float64] | None,
    colour: str,
    marker: str,
    way: str,
) -> None:
    """One direction: every approach, their mean, and the band of twice the spread."""
    mean = deviation(side.mean(axis=1))
    for column in deviation(side).T:
        axes.plot(targets, column, marker, ms=2.5, color=colour, alpha=0.45, lw=0)
    if spread is not None:
        twice = 2 * deviation(spread)
        axes.fill_between(
            targets,
            mean - twice,
            mean + twice,
            color=colour,
            alpha=0.15,
            lw=0,
            label=f"± 2 s {way}",
        )
    axes.plot(targets, mean, marker=marker, ms=5, color=colour, label=f"mean {way}")


def _mean(axes: Axes, targets: NDArray[np.float64], deviation: Scale, result: Iso230) -> None:
    """The mean of both directions, from which M is taken."""
    if result.down is not None:
        middle = deviation((result.up.mean(axis=1) + result.down.mean(axis=1)) / 2)
        axes.plot(targets, middle, "--", color=COMMAND, lw=1.0, label="mean of both")


def _figures(result: Iso230, deviation: Scale) -> str:
    """The letters with their numbers, those that the test gives."""
    given = {name: value for name, value in result.figures().items() if value is not None}
    wanted: list[str] = [n for n in ("A", "R", "E", "M", "B") if n in given]
    wanted = wanted or sorted(given)
    shown = [f"{n.replace('_', ' ')} {float(deviation(given[n])):.3g}" for n in wanted]
    unit = f" {deviation.unit}" if deviation.unit else ""
    return "   ".join(shown) + unit
