"""A reversal seen closely: where backlash, tension and friction show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dualdrive.plots.flanks import strip
from dualdrive.plots.record import PlotError, View, reversals
from dualdrive.plots.style import TABLE, figure_of, picture, scale
from dualdrive.plots.timeline import (
    draw_deflection,
    draw_error,
    draw_torques,
    panels,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.run import Run
    from dualdrive.traces import Trace

__all__ = ["reversal_window", "reversal_zoom"]


def reversal_window(record: Run | Trace, number: int = 1) -> tuple[float, float]:
    """Return (start, stop) in s around a reversal: the change of direction, thrice as wide.

    The change lasts from half the speed of the slower side to the same in the other direction. The
    commanded speed decides, or the table's where no command turns round (a table that hunts).
    number: which one, from 1; negative counts from the last

    Raises PlotError where there are not so many.
    """
    view = View(record)
    begin, end = _change(view, number)
    pad = end - begin
    return max(begin - pad, float(view.t[0])), min(end + pad, float(view.t[-1]))


def _change(view: View, number: int) -> tuple[float, float]:
    _, speed = view.speed()
    spans = reversals(view.t, speed)
    if not spans and "omega_m" in view:
        spans = reversals(view.t, view["omega_m"])
    index = number - 1 if number > 0 else len(spans) + number
    if number == 0 or not 0 <= index < len(spans):
        ways = f"choose 1 .. {len(spans)}" if spans else "give window=, or another motion"
        raise PlotError(f"reversal {number}: this record has {len(spans)}; {ways}")
    return spans[index]


@picture
def reversal_zoom(
    record: Run | Trace,
    number: int = 1,
    *,
    window: tuple[float, float] | None = None,
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Torques, following error and mesh deflection around one reversal of the speed.

    Time counts from the moment the table's speed passes through zero.

    record: a finished run, or a trace with torques and a commanded angle
    number: which reversal, from 1; negative counts from the last
    window: (start, stop) in s instead of the automatic one
    axes:   as many panels as there is something for: torque, error, then deflection and flanks of
            a machine with play

    Raises PlotError where there is no such reversal.
    """
    view = View(record, window or reversal_window(record, number))
    origin = _turning_point(view, window or _change(View(record), number))
    time = scale("s", view.t - origin)
    ratios = [4.0, 3.0, 4.0, 1.0] if view.meshes() else [4.0, 3.0]
    parts = panels(axes, len(ratios), height=1.0 + 0.55 * sum(ratios), ratios=ratios)
    draw_torques(parts[0], view, time, origin, marks=not view.meshes())
    draw_error(parts[1], view, time, origin)
    if view.meshes():
        draw_deflection(parts[2], view, time, origin)
        strip(parts[3], view, time, origin)
    for part in parts:
        part.axvline(0, color=TABLE, lw=0.8, ls=":", zorder=1)
    parts[-1].set_xlabel(time.label("time from the reversal"))
    parts[0].set_title(f"Reversal at {origin:.3f} s")
    figure = figure_of(parts[0])
    figure.align_ylabels(parts)
    return figure


def _turning_point(view: View, change: tuple[float, float]) -> float:
    """Where the table's own speed last passes through zero within the change of direction."""
    begin, end = change
    speed = view["omega_m"] if "omega_m" in view else view.speed()[1]
    crossings = view.t[np.flatnonzero(np.diff(np.sign(speed)) != 0)]
    inside = crossings[(crossings >= begin) & (crossings <= end)]
    return float(inside[-1] if len(inside) else 0.5 * (begin + end))
