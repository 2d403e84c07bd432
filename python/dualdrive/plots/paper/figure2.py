"""Figure 2: the law of both torques, the slow run on it, a move, and the slave's lag."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dualdrive.paper.figure2 import LIMIT, TENSION, shared, stage_totals
from dualdrive.paper.slave_lag import SPEED_GAINS
from dualdrive.plots.flanks import strip
from dualdrive.plots.record import View
from dualdrive.plots.style import COMMAND, MEASURED, PAPER, drive_colour, picture, scale
from dualdrive.plots.style import LIMIT as GREY
from dualdrive.plots.timeline import SECONDS, draw_torques, key_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.paper.figure2 import Figure2
    from dualdrive.run import Run

__all__ = ["sharing"]

#: the way through the paper's stages: there and back, then the other way
_PATH = (0, 1, 2, 3, 4, 3, 2, 1, 0, 5, 6, 7, 8, 7, 6, 5, 0)


@picture
def sharing(data: Figure2) -> Figure:
    """Five panels: law over stages, slow run with flanks, move with flanks, lag."""
    from matplotlib.figure import Figure as Sheet

    sheet = Sheet(figsize=(9.0, 12.0), layout="constrained")
    law, slow, slow_flanks, move, move_flanks, lag = sheet.subplots(
        6, 1, height_ratios=(3.0, 3.0, 0.7, 3.0, 0.7, 3.0)
    )
    _law(law)
    _run(slow, slow_flanks, data.ramp, "550 t held against a slow load")
    _stage_marks(slow, data)
    _run(move, move_flanks, data.move, "550 t through a move", (1.0, 7.0))
    _lag(lag, data)
    return sheet


def _law(axes: Axes) -> None:
    """The static law along the paper's stages."""
    totals = [stage_totals(TENSION, LIMIT)[stage] for stage in _PATH]
    places = np.linspace(0, len(_PATH) - 1, 40 * (len(_PATH) - 1) + 1)
    both = shared(np.interp(places, range(len(_PATH)), totals), TENSION, LIMIT)
    for n, torque in enumerate(both, 1):
        axes.plot(places, torque, color=drive_colour(n), label=f"M{n}")
    axes.axhline(0, color=GREY, lw=0.6, zorder=1)
    for side in (-1, 1):
        label = f"limit ± {LIMIT:g} N·m" if side > 0 else "_"
        axes.axhline(side * LIMIT, color=GREY, ls="--", lw=1.0, label=label)
    axes.set_xticks(range(len(_PATH)), [str(stage) for stage in _PATH])
    axes.set(xlabel="stage", ylabel="motor torque [N·m]", title="Static law")
    axes.margins(y=0.08)
    key_above(axes)


def _run(
    axes: Axes, below: Axes, run: Run, title: str, window: tuple[float, float] | None = None
) -> None:
    view = View(run, window)
    draw_torques(axes, view, SECONDS, marks=False, name="M")
    axes.set_title(title)
    axes.tick_params(labelbottom=False)
    strip(below, view, SECONDS)
    below.set_xlim(axes.get_xlim())
    below.set_xlabel("time [s]")


def _stage_marks(axes: Axes, data: Figure2) -> None:
    for stage in data.stages:
        axes.axvline(stage.t, color=COMMAND, lw=0.7, ls=":")
        axes.annotate(
            str(stage.number), (stage.t, 0.02), xycoords=("data", "axes fraction"),
            xytext=(3, 0), textcoords="offset points", fontsize=9, fontweight="bold",
            bbox={"fc": PAPER, "ec": "none", "pad": 0.8},
        )  # fmt: skip


def _lag(axes: Axes, data: Figure2) -> None:
    """The following error at each lag, with the preset's speed gain."""
    runs = {lag: run for (gain, lag), run in data.lag.light.items() if gain == SPEED_GAINS[-1]}
    unit = scale("rad", np.concatenate([run["e"] for run in runs.values()]), "arcsec")
    colours = ("#9ECAE1", "#4292C6", "#08519C", MEASURED)
    for colour, (lag, run) in zip(colours, reversed(list(runs.items())), strict=False):
        k = (run.t >= 1.8) & (run.t <= 6.0)
        axes.plot(run.t[k], unit(run["e"][k]), color=colour, label=f"δt {1e3 * lag:g} ms")
    axes.set(xlabel="time [s]", ylabel=unit.label("following error"))
    axes.set_title("Slave lag, 100 t")
    axes.margins(y=0.08)
    key_above(axes)
