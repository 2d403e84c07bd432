"""Limit cycles: one orbit, a curve of orbits through folds, a map of where a machine hunts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.record import PlotError
from dualdrive.plots.style import (
    BAND,
    FIRST,
    LIMIT,
    SECOND,
    TABLE,
    drive_colour,
    figure_of,
    new_axes,
    picture,
    scale,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.cycles import Branch, Orbit, Predicted, Survey

__all__ = ["cycle", "cycle_branch", "cycle_map"]

Array = NDArray[np.float64]


@picture
def cycle(orbit: Orbit, predicted: Sequence[Predicted] = (), title: str = "") -> Figure:
    """One period: the table, the meshes in their play, the motors; and the Floquet multipliers."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 6.2), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=[5, 3])
    over_time = [figure.add_subplot(grid[k, 0]) for k in range(3)]
    for axes in over_time[:2]:
        axes.tick_params(labelbottom=False)
    _table(over_time[0], orbit, predicted)
    _meshes(over_time[1], orbit)
    _motors(over_time[2], orbit)
    over_time[2].set_xlabel("time [s]")
    _phase(figure.add_subplot(grid[:2, 1]), orbit)
    _multipliers(figure.add_subplot(grid[2, 1]), orbit)
    kind = "attracting" if orbit.stable else "repelling"
    name = f"{orbit.machine.name}: {kind} cycle, {orbit.frequency_hz:.4g} Hz"
    figure.suptitle(title or name, x=0.01, ha="left", fontsize=10, fontweight="bold")
    return figure


def _table(axes: Axes, orbit: Orbit, predicted: Sequence[Predicted]) -> None:
    angle = scale("rad", orbit.signals["theta_m"], "arcsec")
    axes.plot(orbit.t, angle(orbit.signals["theta_m"]), color=TABLE, label="orbit")
    for k, one in enumerate(predicted):
        label = None if k else "describing function"
        for side in (-1, 1):
            level = float(angle(side * one.amplitude))
            axes.axhline(level, color=LIMIT, ls="--", lw=0.9, label=label if side > 0 else None)
    axes.set_ylabel(angle.label("table"))
    if predicted:
        axes.legend(loc="upper right")


def _meshes(axes: Axes, orbit: Orbit) -> None:
    """Deflections, with the play of the first mesh shaded."""
    names = [name for name in ("mesh_1.twist", "mesh_2.twist") if name in orbit.signals]
    angle = scale("rad", prefer="mrad")
    if names:
        half = float(angle(orbit.machine.get(f"{names[0].removesuffix('.twist')}.gap")))
        axes.axhspan(-half, half, color=BAND, lw=0, label="play")
    for k, name in enumerate(names):
        label, colour = name.split(".")[0], drive_colour(k + 1)
        axes.plot(orbit.t, angle(orbit.signals[name]), label=label, color=colour, lw=2.2 - k)
    axes.set_ylabel(angle.label("deflection"))
    axes.margins(y=0.3)  # room for the legend
    axes.legend(loc="upper right", ncols=3)


def _motors(axes: Axes, orbit: Orbit) -> None:
    names = [name for name in ("T_1", "T_2") if name in orbit.signals]
    torque = scale("N*m", [orbit.signals[name] for name in names])
    for k, name in enumerate(names):
        colour = drive_colour(k + 1)
        axes.plot(orbit.t, torque(orbit.signals[name]), label=name, color=colour, lw=2.2 - k)
    axes.set_ylabel(torque.label("motors"))
    axes.margins(y=0.3)
    axes.legend(loc="upper right", ncols=2)


def _phase(axes: Axes, orbit: Orbit) -> None:
    angle = scale("rad", orbit.signals["theta_m"], "arcsec")
    speed = scale("rad/s", orbit.signals["omega_m"])
    x, y = angle(orbit.signals["theta_m"]), speed(orbit.signals["omega_m"])
    axes.plot(x, y, color=TABLE)
    axes.set_xlabel(angle.label("table angle"))
    axes.set_ylabel(speed.label("table speed"))
    axes.margins(0.06)


def _multipliers(axes: Axes, orbit: Orbit) -> None:
    turn = np.exp(2j * np.pi * np.linspace(0, 1, 200))
    axes.plot(turn.real, turn.imag, color=LIMIT, lw=0.9)
    inside = np.abs(orbit.multipliers) < 1
    for where, colour in ((inside, FIRST), (~inside, SECOND)):
        some = orbit.multipliers[where]
        axes.plot(some.real, some.imag, "o", ms=4, mfc="none", color=colour)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.set_xlabel("Floquet multipliers, real")
    axes.set_ylabel("imaginary")


@picture
def cycle_branch(branch: Branch, label: str = "", unit: str = "", title: str = "") -> Figure:
    """Size and frequency along a curve of orbits: full lines attract, dashed ones repel.

    label, unit: of the parameter; its SI unit
    """
    top, below = new_axes(2, 7.0, 5.6)
    what = scale(unit, branch.values)
    angle = scale("rad", branch.amplitude, "arcsec")
    for axes, values, name in (
        (top, angle(2 * branch.amplitude), angle.label("table, peak to peak")),
        (below, branch.frequency_hz, "frequency [Hz]"),
    ):
        x = what(branch.values)
        for begin, end, stable in _pieces(branch.stable):
            axes.plot(x[begin:end], values[begin:end], "-" if stable else "--",
                      color=FIRST if stable else SECOND, marker=".", ms=4)  # fmt: skip
        for fold in branch.folds:
            axes.axvline(float(what(fold)), color=LIMIT, ls=":", lw=1)
        axes.set_ylabel(name)
        axes.margins(0.04)
    top.plot([], [], "-", color=FIRST, label="attracting")
    if not branch.stable.all():
        top.plot([], [], "--", color=SECOND, label="repelling")
    top.legend(loc="best")
    top.set_title(title or f"{branch.orbits[0].machine.name}: limit cycles")
    below.set_xlabel(what.label(label or branch.path))
    return figure_of(top)


def _pieces(stable: NDArray[np.bool_]) -> list[tuple[int, int, bool]]:
    """Runs of equal stability, each drawn on to the first point of the next."""
    edges = [0, *(np.flatnonzero(np.diff(stable)) + 1).tolist(), stable.size]
    return [(a, min(b + 1, stable.size), bool(stable[a])) for a, b in pairwise(edges)]


@picture
def cycle_map(
    survey: Survey, units: Sequence[str] = (), labels: Sequence[str] = (), title: str = ""
) -> Figure:
    """Size and frequency over one or two axes; white where none was found.

    units, labels: of the axes, SI units. Raises PlotError for more than two axes.
    """
    names = list(survey.axes)
    if len(names) > 2:
        raise PlotError(f"cycle map: {len(names)} axes can't be drawn; hold all but two fixed")
    scales = [
        scale(units[k] if units else "", values) for k, values in enumerate(survey.axes.values())
    ]
    shown = [s(values) for s, values in zip(scales, survey.axes.values(), strict=True)]
    words = [s.label(labels[k] if labels else names[k]) for k, s in enumerate(scales)]
    size = scale("rad", prefer="arcsec")(survey.grid("peak_to_peak").filled(np.nan))
    hertz = survey.grid("frequency_hz").filled(np.nan)
    heading = title or f"{survey.machine.name}: limit cycles"
    if len(names) == 1:
        return _lines(shown[0], size, hertz, words[0], heading)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    for axes, values, what in zip(
        figure.subplots(1, 2), (size, hertz), ("peak to peak [arcsec]", "frequency [Hz]"),
        strict=True,
    ):  # fmt: skip
        colours = axes.pcolormesh(shown[1], shown[0], values, shading="nearest", cmap="viridis")
        axes.grid(visible=False)
        axes.set_facecolor("white")
        axes.set_xlabel(words[1])
        axes.set_ylabel(words[0])
        figure.colorbar(colours, ax=axes, label=what)
    figure.suptitle(f"{heading} (white: none found)", x=0.01, ha="left", fontsize=10,
                    fontweight="bold")  # fmt: skip
    return figure


def _lines(x: Array, size: Array, hertz: Array, word: str, heading: str) -> Figure:
    top, below = new_axes(2, 7.0, 5.0)
    top.plot(x, size, ".-", color=TABLE)
    below.plot(x, hertz, ".-", color=TABLE)
    rest = np.isnan(size)
    top.plot(x[rest], np.zeros(rest.sum()), "x", color=LIMIT, label="none found")
    if rest.any():
        top.legend(loc="best")
    top.set_ylabel("table, peak to peak [arcsec]")
    below.set_ylabel("frequency [Hz]")
    below.set_xlabel(word)
    for axes in (top, below):
        axes.margins(0.04)
    top.set_title(heading)
    return figure_of(top)
