"""Pictures over time: motor torques, following error, deflection of the meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.flanks import change_marks, play_band, strip
from dualdrive.plots.record import PlotError, View
from dualdrive.plots.style import (
    BAND,
    COMMAND,
    LIMIT,
    TABLE,
    Scale,
    drive_colour,
    figure_of,
    new_axes,
    picture,
    scale,
    single,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.run import Run
    from dualdrive.traces import Trace

__all__ = ["following_error", "mesh_deflection", "torques"]

Array = NDArray[np.float64]
Window = tuple[float, float]

SECONDS = Scale(1.0, "s")


@picture
def torques(
    record: Run | Trace, *, window: Window | None = None, axes: Axes | None = None
) -> Figure:
    """Motor torques over each other, with their limits, the tension, and flank changes.

    record: a finished run, or a trace with ``T_1``, ``T_2`` (or currents ``I_1``, ``I_2``)
    window: (start, stop) in s; all of it unless given

    Raises PlotError where there is neither torque nor current, or nothing in the window.
    """
    axes = single(axes)
    view = View(record, window)
    draw_torques(axes, view, SECONDS)
    axes.set_xlabel("time [s]")
    axes.set_title("Motor torques" if "torque" in axes.get_ylabel() else "Motors")
    return figure_of(axes)


def draw_torques(
    axes: Axes,
    view: View,
    time: Scale,
    origin: float = 0.0,
    *,
    marks: bool = True,
    name: str = "motor ",
) -> None:
    """What `torques` and the pictures made of several panels share.

    name: what stands before the number of a drive in the key
    """
    what, channels = "torque", view.numbered("T_")
    if not channels:
        what, channels = "current", view.numbered("I_")
    if not channels:
        raise PlotError("no motor torque T_1 and no current I_1; record one of them")
    unit = view.scale(*channels.values())
    if unit.unit.endswith("N"):
        what = "force"
    drive_lines(axes, view, channels, unit, time, origin, name)
    if what != "current":
        _limits(axes, view, unit, time, origin)
    if len(channels) > 1 or np.ptp(np.sign(view[channels[min(channels)]])) > 0:
        axes.axhline(0, color=LIMIT, lw=0.6, zorder=1)
    axes.margins(y=0.08)
    if marks:
        change_marks(axes, view, time, origin)
    axes.set_ylabel(unit.label(f"motor {what}"))
    key_above(axes)


def _limits(axes: Axes, view: View, unit: Scale, time: Scale, origin: float) -> None:
    """The torque limit where it is near, and the tension the motors hold against each other."""
    limits = {view.parameter(f"motor_{n}.T_max") for n in view.numbered("T_")}
    peak = max(float(np.abs(view[name]).max()) for name in view.numbered("T_").values())
    highest = limits.pop() if len(limits) == 1 else None
    if highest is not None and np.isfinite(highest) and highest <= 1.5 * peak:
        for side in (-1, 1):
            name = f"limit ±{float(unit(highest)):.4g} {unit.unit}" if side > 0 else "_"
            axes.axhline(side * float(unit(highest)), color=LIMIT, ls="--", lw=1.0, label=name)
    if "tension" in view and np.any(view["tension"]) and len(view.numbered("T_")) > 1:
        for side in (-1, 1):
            held = unit(0.5 * side * view["tension"])
            name = "±½ tension" if side > 0 else "_"
            axes.plot(time(view.t - origin), held, color=COMMAND, ls=":", lw=1.0, label=name)


@picture
def following_error(
    record: Run | Trace, *, window: Window | None = None, axes: Axes | None = None
) -> Figure:
    """Commanded minus actual table angle, over the stretches in which the command moves.

    record: a finished run, or a trace with ``theta_ref`` and ``theta_m``
    window: (start, stop) in s; all of it unless given

    Raises PlotError where there is no commanded angle, or nothing in the window.
    """
    axes = single(axes)
    view = View(record, window)
    draw_error(axes, view, SECONDS)
    axes.set_xlabel("time [s]")
    axes.set_title("Following error")
    return figure_of(axes)


def draw_error(axes: Axes, view: View, time: Scale, origin: float = 0.0) -> None:
    """What `following_error` and the pictures made of several panels share."""
    error = view.error()
    if error is None:
        raise PlotError("no following error: theta_ref and theta_m are both needed")
    unit = scale(view.unit("theta_m") if "theta_m" in view else view.unit("e"), error)
    axes.plot(time(view.t - origin), unit(error), color=TABLE)
    axes.axhline(0, color=LIMIT, lw=0.6, zorder=1)
    axes.margins(y=0.08)
    axes.set_ylabel(unit.label("following error"))
    shade_motion(axes, view, time, origin)


@picture
def mesh_deflection(
    run: Run, *, window: Window | None = None, axes: Sequence[Axes] | None = None
) -> Figure:
    """Deflection of every mesh within its play, and below which flank carries.

    The deflection is θ_c − i_m θ_m at the pinion; beyond the band ±Δ the flank is loaded, and how
    far beyond is the torque over the stiffness.

    run:    a finished run with ``mesh_n.deflection`` and ``mesh_n.flank``
    window: (start, stop) in s; all of it unless given
    axes:   two panels: deflection, flanks

    Raises PlotError where the machine has no play, or nothing lies in the window.
    """
    above, below = panels(axes, 2, height=4.4, ratios=(4, 1))
    view = View(run, window)
    draw_deflection(above, view, SECONDS)
    strip(below, view, SECONDS)
    below.set_xlabel("time [s]")
    above.set_title("Mesh deflection")
    return figure_of(above)


def draw_deflection(axes: Axes, view: View, time: Scale, origin: float = 0.0) -> None:
    """What `mesh_deflection` and the pictures made of several panels share."""
    meshes = view.meshes()
    if not meshes:
        raise PlotError("no mesh with play and recorded deflection; draw another picture")
    channels = {n: f"mesh_{n}.deflection" for n in meshes}
    unit = view.scale(*channels.values(), prefer="mrad")
    gaps = {view.parameter(f"mesh_{n}.gap") for n in meshes}
    for gap in sorted(g for g in gaps if g is not None):
        play_band(axes, gap, unit)
    drive_lines(axes, view, channels, unit, time, origin, "mesh ")
    axes.margins(y=0.08)
    axes.set_ylabel(unit.label("deflection at the pinion"))
    key_above(axes)


# --- shared by the pictures of this package -------------------------------------------------------


def panels(
    axes: Sequence[Axes] | None, count: int, *, height: float, ratios: Sequence[float] | None = None
) -> list[Axes]:
    """The caller's axes, or new ones below each other. PlotError if there are not enough."""
    if axes is None:
        return new_axes(count, 8.0, height, ratios)
    if len(axes) != count:
        raise PlotError(f"axes: {len(axes)} given; this picture has {count} panels")
    return list(axes)


def key_above(axes: Axes, columns: int = 6) -> None:
    """The key in one row above the axes at the right, where no line can be."""
    axes.legend(ncols=columns, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0)


def drive_lines(
    axes: Axes,
    view: View,
    channels: Mapping[int, str],
    unit: Scale,
    time: Scale,
    origin: float,
    name: str,
) -> None:
    """One line per drive; a line that would hide an earlier one is dashed.

    name: what stands before the number of a drive in the key
    """
    reach = max(float(np.ptp(view[channel])) for channel in channels.values())
    drawn: list[Array] = []
    for n, channel in channels.items():
        values = view[channel]
        hides = any(float(np.abs(values - other).max()) < 0.02 * reach for other in drawn)
        axes.plot(
            time(view.t - origin),
            unit(values),
            color=drive_colour(n),
            ls=(0, (5, 4)) if hides else "-",
            label=f"{name}{n}",
        )
        drawn.append(values)


def shade_motion(axes: Axes, view: View, time: Scale, origin: float = 0.0) -> None:
    """Shade the stretches in which the commanded angle moves, where it rests long enough too."""
    spans = view.moving()
    if sum(end - begin for begin, end in spans) > 0.95 * (view.t[-1] - view.t[0]):
        return
    for k, span in enumerate(spans):
        low, high = time(np.array(span) - origin)
        label = "command moves" if k == 0 else "_"
        axes.axvspan(low, high, color=BAND, alpha=0.6, lw=0, zorder=0, label=label)
    if spans:
        key_above(axes)
