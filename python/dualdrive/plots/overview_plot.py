"""The default picture of a run: motion, following error, torques, meshes and flanks over time."""

from __future__ import annotations

from textwrap import shorten
from typing import TYPE_CHECKING

from dualdrive.plots.flanks import strip
from dualdrive.plots.record import View
from dualdrive.plots.style import COMMAND, TABLE, figure_of, new_axes, picture, scale
from dualdrive.plots.timeline import (
    SECONDS,
    Window,
    draw_deflection,
    draw_error,
    draw_torques,
    key_above,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.run import Run
    from dualdrive.traces import Trace

__all__ = ["overview"]


@picture
def overview(record: Run | Trace, *, window: Window | None = None) -> Figure:
    """The whole run on one page; panels that the machine or record has nothing for are left out.

    record: a finished run, or a trace
    window: (start, stop) in s; all of it unless given

    Raises PlotError where there is nothing to draw, or nothing in the window.
    """
    view = View(record, window)
    parts = {"motion": 3.0}
    if view.error() is not None:
        parts["error"] = 3.0
    if view.numbered("T_") or view.numbered("I_"):
        parts["torques"] = 3.6
    if view.meshes():
        parts |= {"deflection": 3.6, "flanks": 0.36 + 0.36 * len(view.meshes())}
    axes = new_axes(len(parts), 8.5, 0.9 + 0.62 * sum(parts.values()), list(parts.values()))
    panel = dict(zip(parts, axes, strict=True))
    _motion(panel["motion"], view)
    if "error" in panel:
        draw_error(panel["error"], view, SECONDS)
    if "torques" in panel:
        draw_torques(panel["torques"], view, SECONDS, marks="deflection" not in panel)
    if "deflection" in panel:
        draw_deflection(panel["deflection"], view, SECONDS)
        strip(panel["flanks"], view, SECONDS)
    axes[-1].set_xlabel("time [s]")
    figure = figure_of(axes[0])
    figure.align_ylabels(axes)
    figure.suptitle(_title(view), x=0.01, ha="left", fontsize=11, fontweight="bold")
    return figure


def _motion(axes: Axes, view: View) -> None:
    """Commanded and actual angle of the table; they differ by less than a line's width."""
    names = [name for name in ("theta_m", "theta_ref") if name in view]
    if not names:
        what, speed = view.speed()
        unit = scale(view.unit("omega_m"), speed)
        axes.plot(view.t, unit(speed), color=TABLE)
        axes.set_ylabel(unit.label(what))
        return
    unit = view.scale(*names, prefer=None)
    looks = {
        "theta_m": {"color": TABLE, "lw": 1.8, "label": "table"},
        "theta_ref": {"color": COMMAND, "lw": 1.0, "ls": "--", "label": "command"},
    }
    for name in names:
        axes.plot(view.t, unit(view[name]), **looks[name])  # type: ignore[arg-type]
    axes.margins(y=0.08)
    axes.set_ylabel(unit.label("table position" if unit.unit.endswith("m") else "table angle"))
    key_above(axes)


def _title(view: View) -> str:
    """Whose run it is, what was commanded, and that it failed if it did."""
    if view.run is None:
        return shorten(str(getattr(view.source, "name", "trace")), 70, placeholder=" ...")
    run = view.run
    words = [run.machine.name]
    if run.motion is not None:
        words.append(run.motion.text if len(run.motion.text) < 70 else run.motion.kind)
    if not run.ok:
        words.append(f"stopped: {run.status}")
    return "  |  ".join(words)
