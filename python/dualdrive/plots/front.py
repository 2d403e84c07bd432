"""Heat against accuracy: all designs, the best trades among them, the least tension."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dualdrive.plots.style import COMMAND, FIRST, LIMIT, SECOND, picture, scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.optimise import Front

__all__ = ["pareto"]

_WORDS = {
    "heat": "copper loss of all motors",
    "torque_rms": "RMS torque of the motor that has most",
}


@picture
def pareto(front: Front) -> Figure:
    """Left the front in heat and accuracy, right the margin of the flanks over tension."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    trade, margin = figure.subplots(1, 2)
    _trade(trade, front)
    _margin(margin, front)
    figure.suptitle(
        f"{front.machine.name}, worst of {len(front.cases)} corners", x=0.01, ha="left", fontsize=11
    )
    return figure


def _trade(axes: Axes, front: Front) -> None:
    units = front.units()
    known = [d for d in front.designs if d.known]
    x = np.array([getattr(d, front.cost) for d in known], float)
    y = np.array([getattr(d, front.accuracy) for d in known], float)
    cost = scale(units[front.cost], x)
    error = scale(
        units[front.accuracy], prefer="arcsec" if units[front.accuracy] == "rad" else "um"
    )
    closed = np.array([d.apart for d in known])
    axes.plot(cost(x[~closed]), error(y[~closed]), "o", ms=3, mfc="none", color=LIMIT,
              label="a flank opens")  # fmt: skip
    axes.plot(cost(x[closed]), error(y[closed]), "o", ms=3, color=LIMIT, label="flanks stay closed")
    best = [front.designs[k] for k in front.best]
    axes.step(
        cost([getattr(d, front.cost) for d in best]),
        error([getattr(d, front.accuracy) for d in best]),
        where="post",
        color=FIRST,
        marker="o",
        ms=4,
        label="best trades",
    )
    axes.set_xlabel(cost.label(_WORDS[front.cost]))
    axes.set_ylabel(error.label(front.accuracy.replace("_", " ")))
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.04)
    axes.set_title("Heat against accuracy")
    axes.legend(loc="upper right")
    if front.unstable:
        axes.text(0.99, 0.66, f"{front.unstable} unstable designs not drawn",
                  transform=axes.transAxes, ha="right", fontsize=8)  # fmt: skip


def _margin(axes: Axes, front: Front) -> None:
    known = [d for d in front.least.designs if d.known]
    x = np.array([d.values["controller.T_ten"] for d in known])
    y = np.array([d.margin for d in known], float)
    torque = scale("N*m", x)
    axes.plot(torque(x), torque(y), color=FIRST)
    if front.least.tension is not None:
        least = float(torque(front.least.tension))
        axes.axvline(least, color=SECOND, ls=":")
        axes.annotate(f" least {least:.4g} {torque.unit}", (least, 0.95), color=SECOND,
                      xycoords=("data", "axes fraction"))  # fmt: skip
    else:
        axes.text(0.03, 0.9, "no tension up to here keeps the flanks closed",
                  transform=axes.transAxes, color=COMMAND)  # fmt: skip
    axes.set_ylim(bottom=0.0, top=None if y.any() else 1.0)
    axes.set_xlabel(torque.label("tension"))
    axes.set_ylabel(torque.label("least torque on a closed flank, motor side"))
    axes.set_title("Flanks over tension, gain as it is")
