"""The play of a mesh as estimated: the loop in the trace, and how sure the number is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dualdrive.plots.record import PlotError
from dualdrive.plots.style import BAND, FIRST, LIMIT, SECOND, Scale, picture, scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.identify import PlayEstimate

__all__ = ["play"]


@picture
def play(*estimates: PlayEstimate) -> Figure:
    """One row per mesh: deflection over torque with the fitted flanks, distribution of the play.

    Raises PlotError when no estimate is given.
    """
    from matplotlib.figure import Figure

    if not estimates:
        raise PlotError("play: nothing to draw; give at least one estimate")
    figure = Figure(figsize=(9.0, 3.6 * len(estimates)), layout="constrained")
    rows = figure.subplots(len(estimates), 2, squeeze=False, width_ratios=[3, 2])
    for (loop, sure), estimate in zip(rows, estimates, strict=True):
        least = estimate.full.value if np.isfinite(estimate.full.value) else estimate.full.low
        angle = scale("rad", prefer="mrad" if least < 0.01 else "deg")
        _loop(loop, estimate, angle)
        _distribution(sure, estimate, angle)
    return figure


def _loop(axes: Axes, estimate: PlayEstimate, angle: Scale) -> None:
    """Every sample; idle torque crosses the play, load rests on either flank."""
    cloud = estimate.cloud
    torque = scale("N*m", cloud.torque)
    deflection = angle(cloud.deflection)
    axes.plot(torque(cloud.torque), deflection, ".", ms=1.2, color=LIMIT, label="samples")
    if estimate.compliance is not None:
        half = float(angle(estimate.half_gap.value))
        axes.axhspan(-half, half, color=BAND, lw=0, zorder=0, label="play")
        highest = float(np.abs(cloud.torque).max())
        for flank in (-1, 1):
            pushed = flank * np.array([0.0, highest])
            bent = flank * estimate.half_gap.value + estimate.compliance.value * pushed
            label = "flanks as fitted" if flank > 0 else None
            axes.plot(torque(pushed), angle(bent), color=SECOND, lw=1.6, label=label)
    axes.margins(0.03)
    axes.set_xlabel(torque.label(f"torque of motor {estimate.drive}"))
    axes.set_ylabel(angle.label("drive minus ring"))
    axes.set_title(f"Mesh {estimate.drive}")
    axes.legend(loc="best", markerscale=5)


def _distribution(axes: Axes, estimate: PlayEstimate, angle: Scale) -> None:
    """Bootstrap draws with the interval, or the bound where there is no more."""
    axes.set_xlabel(angle.label("full play at zero torque"))
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.grid(visible=False, axis="y")
    if estimate.status == "bounded":
        least = float(angle(estimate.full.low))
        axes.axvspan(least, 1.5 * least, color=FIRST, alpha=0.2, lw=0)
        axes.axvline(least, color=FIRST)
        axes.set_xlim(0, 1.5 * least or 1.0)
        axes.set_title(f"at least {least:.3g} {angle.unit}")
        return
    axes.hist(angle(estimate.draws), bins=60, density=True, color=FIRST, alpha=0.55)
    value, low, high = angle([estimate.full.value, estimate.full.low, estimate.full.high])
    axes.axvspan(low, high, color=FIRST, alpha=0.12, lw=0)
    axes.axvline(value, color=FIRST)
    axes.margins(x=0.05)
    axes.set_title(f"{value:.4g} {angle.unit}  [{low:.4g} .. {high:.4g}]")
