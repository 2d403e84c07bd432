"""The picture of an estimated play: the loop in the trace, and how sure the number is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dualdrive.identify.play_result import PlayEstimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_play(*estimates: PlayEstimate) -> Figure:
    """One row per mesh: deflection over torque with the fitted flanks, distribution of the play.

    The figure belongs to no window; save it with ``figure.savefig(path)``.

    Raises:
        ValueError: no estimate given.

    """
    from matplotlib.figure import Figure

    if not estimates:
        raise ValueError("draw_play: nothing to draw")
    figure = Figure(figsize=(11, 4.2 * len(estimates)), layout="constrained")
    rows = figure.subplots(len(estimates), 2, squeeze=False, width_ratios=[3, 2])
    for (loop, sure), estimate in zip(rows, estimates, strict=True):
        _loop(loop, estimate)
        _distribution(sure, estimate)
    return figure


def _loop(axes: Axes, estimate: PlayEstimate) -> None:
    """Every sample; idle torque crosses the play, load rests on either flank."""
    cloud = estimate.cloud
    axes.plot(cloud.torque, np.degrees(cloud.deflection), ".", ms=1, alpha=0.35, color="tab:gray")
    if estimate.compliance is not None:
        highest = float(np.abs(cloud.torque).max())
        for flank in (-1, 1):
            torque = flank * np.array([0.0, highest])
            bend = estimate.compliance.value * torque
            flat = np.degrees(flank * estimate.half_gap.value + bend)
            axes.plot(torque, flat, color="tab:red", lw=1.5)
    axes.set_xlabel(f"torque of motor {estimate.drive} [N·m]")
    axes.set_ylabel("drive minus ring [deg]")
    axes.set_title(f"mesh {estimate.drive}: {estimate.note}", fontsize="medium")
    axes.grid(alpha=0.3)


def _distribution(axes: Axes, estimate: PlayEstimate) -> None:
    """Bootstrap draws with the interval, or the bound where there is no more."""
    axes.set_xlabel("full play at zero torque [deg]")
    axes.set_yticks([])
    if estimate.status == "bounded":
        least = np.degrees(estimate.full.low)
        axes.axvspan(least, 1.5 * least, color="tab:blue", alpha=0.2)
        axes.axvline(least, color="tab:blue")
        axes.set_xlim(0, 1.5 * least or 1.0)
        axes.set_title(f"at least {least:.3g}°", fontsize="medium")
        return
    axes.hist(np.degrees(estimate.draws), bins=60, density=True, color="tab:blue", alpha=0.6)
    value, low, high = np.degrees([estimate.full.value, estimate.full.low, estimate.full.high])
    axes.axvspan(low, high, color="tab:blue", alpha=0.15)
    axes.axvline(value, color="tab:blue")
    axes.set_title(f"{value:.4g}° [{low:.4g}° .. {high:.4g}°]", fontsize="medium")
