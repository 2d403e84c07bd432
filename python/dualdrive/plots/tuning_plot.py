"""Pictures of a tuning: one per step, and a sheet with the machine before and after."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.record import PlotError
from dualdrive.plots.style import COMMAND, LIMIT, drive_colour, picture, scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.tune import Step, Tuning
    from dualdrive.tune.result import Assessment, Panel

__all__ = ["tuning", "tuning_step"]


#: lines of marks that stand in one panel
_MARKS: Final = (":", "--", "-.", (0, (6, 1, 1, 1, 1, 1)))
_FEW = 3  # lines in a legend that find room within the axes


@picture
def tuning_step(step: Step) -> Figure:
    """The diagrams of one step below each other. Raises PlotError for a step without any."""
    from matplotlib.figure import Figure

    if not step.panels:
        raise PlotError(f"step {step.number}: nothing to draw; it was {step.status}")
    heights = [max(2.5, 0.19 * len(panel.names)) for panel in step.panels]
    figure = Figure(figsize=(8.0, sum(heights) + 0.4), layout="constrained")
    rows = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    figure.suptitle(f"({step.number}) {step.title}", fontsize=11, x=0.01, ha="left")
    for axes, panel in zip(rows, step.panels, strict=True):
        _panel(axes, panel)
    return figure


def _panel(axes: Axes, panel: Panel) -> None:
    if panel.names:
        _rows(axes, panel)
    else:
        for k, curve in enumerate(panel.curves, 1):
            hides = any(_alike(curve.y, other.y) for other in panel.curves[: k - 1])
            axes.plot(curve.x, curve.y, color=drive_colour(k), ls=_line(hides), label=curve.label)
        if panel.log_x:
            axes.set_xscale("log")
        if panel.y_range:
            axes.set_ylim(*panel.y_range)
            axes.axhline(0.0, color=LIMIT, lw=0.8)
        marks = _marks(panel)
        for (place, word, colour), style in zip(marks, cycle(_MARKS), strict=False):
            axes.axvline(place, color=colour, lw=1.2, ls=style, label=f"{word}: {place:.4g}")
        entries = len(panel.curves) + len(marks)
        if entries > _FEW:
            axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        elif entries > 1:
            axes.legend(loc="best")
    axes.set_title(panel.title)
    axes.set_xlabel(panel.x)
    axes.set_ylabel(panel.y)


def _marks(panel: Panel) -> list[tuple[float, str, str]]:
    """Place, words and colour, which is that of the curve they name; one for each place."""
    found: dict[str, tuple[float, list[str], str]] = {}
    for place, word in panel.marks:
        named = (
            drive_colour(k)
            for k, c in enumerate(panel.curves, 1)
            if c.label and word.endswith(c.label)
        )
        colour = next(named, COMMAND)
        found.setdefault(f"{place:.4g}", (place, [], colour))[1].append(word)
    return [(place, "\n".join(words), colour) for place, words, colour in found.values()]


def _alike(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether a curve lies on another one, to the eye."""
    return one.shape == other.shape and bool(np.abs(one - other).max() < 0.02 * np.ptp(other))


def _line(hides: bool) -> str:
    """Dashed where a curve would hide another one."""
    return "--" if hides else "-"


def _rows(axes: Axes, panel: Panel) -> None:
    """Named rows as bars from zero."""
    (curve,) = panel.curves
    axes.barh(curve.y, curve.x, color=drive_colour(2), height=0.6)
    axes.set_yticks(range(len(panel.names)), panel.names, fontsize=7)
    axes.set_ylim(len(panel.names) - 0.5, -0.5)
    widest = float(np.abs(curve.x).max(initial=0.0)) or 1.0
    axes.set_xlim(-1.1 * widest, 1.1 * widest)
    axes.axvline(0.0, color=COMMAND, lw=0.8)
    if not curve.x.any():
        axes.text(0.98, 0.05, "no difference", transform=axes.transAxes, ha="right", color=COMMAND)


@picture
def tuning(done: Tuning) -> Figure:
    """Following error and both motor torques on the test move, before and after.

    The torques are figure 6 of the paper. A machine whose run has no end says so.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 5.6), layout="constrained")
    grid = figure.subplots(2, 2, sharex=True, sharey="row")
    sides = (("before", done.before), ("after", done.after))
    runs = [found.run for _, found in sides if found.run is not None]
    errors = np.concatenate([run["e"] for run in runs]) if runs else np.zeros(1)
    unit = done.machine.unit_of("e", "rad")
    angle = scale(unit, prefer="arcsec" if unit == "rad" else "um")
    torque = scale("N*m", np.concatenate([run["T_1"] for run in runs]) if runs else ())
    for (above, below), (title, found) in zip(grid.T, sides, strict=True):
        above.set_title(f"{done.machine.name} {title} tuning")
        below.set_xlabel("time [s]")
        if found.run is None:
            _no_run(above, found)
            _no_run(below, found)
            continue
        run = found.run
        above.plot(run.t, angle(run["e"]), color=COMMAND)
        hides = _alike(run["T_1"], run["T_2"])
        below.plot(run.t, torque(run["T_1"]), color=drive_colour(1), label="master")
        below.plot(run.t, torque(run["T_2"]), color=drive_colour(2), ls=_line(hides), label="slave")
        below.legend(loc="best", ncols=2)
        above.annotate(
            "; ".join(f"{name} {found.spoken(name)}" for name in ("hunting", "torque ripple 1")),
            (0.99, 0.97),
            xycoords="axes fraction",
            ha="right",
            va="top",
            fontsize=8,
        )
    grid[0, 0].set_ylabel(angle.label("following error"))
    grid[1, 0].set_ylabel(torque.label("motor torque"))
    top = float(angle(np.abs(errors)).max()) or 1.0
    grid[0, 0].set_ylim(-1.1 * top, 1.35 * top)
    return figure


def _no_run(axes: Axes, found: Assessment) -> None:
    axes.text(
        0.5,
        0.5,
        f"unstable: {found.growing}",
        transform=axes.transAxes,
        ha="center",
    )
