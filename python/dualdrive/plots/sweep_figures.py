"""A sweep seen at once: figures as lines over one axis, or one figure as a map over two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from dualdrive.plots.record import PlotError
from dualdrive.plots.style import BAND, LIMIT, drive_colour, figure_of, new_axes, picture, scale

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
__all__ = ["sweep_figures"]


class Sweep(Protocol):
    """What is drawn of a `dualdrive.sweeps.Sweep`, which can draw itself and so stands above."""

    @property
    def axes(self) -> Mapping[str, np.ndarray[Any, Any]]:
        """Path of each swept parameter and its values, SI."""

    @property
    def figures(self) -> Sequence[str]:
        """Names of the figures."""

    @property
    def dataset(self) -> xr.Dataset:
        """Every figure over the axes."""

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Names of machine and motion among others."""

    def unit(self, name: str) -> str:
        """The SI unit of an axis or figure."""

    def words(self, path: str, value: float) -> str:
        """A value of an axis as people read it."""


@picture
def sweep_figures(sweep: Sweep, figures: str | Sequence[str] | None = None) -> Figure:
    """Draw figures of a sweep: lines over one axis, a map over two.

    figures: names; by default the following errors and torques (lines), and (map) the standstill
             amplitude where the table hunts anywhere, else the peak following error
    Further axes stay at their first value, which the title names. Failed runs leave a gap, with a
    grey mark.

    Raises PlotError for a figure that the sweep does not have.
    """
    names = [figures] if isinstance(figures, str) else list(figures or ())
    for name in names:
        if name not in sweep.figures:
            ways = ", ".join(sweep.figures)
            raise PlotError(f"figure {name!r}: this sweep has none of that name; choose of {ways}")
    axes = list(sweep.axes)
    if len(axes) == 1:
        return _lines(sweep, names)
    return _map(sweep, names[0] if names else _telling(sweep))


def _telling(sweep: Sweep) -> str:
    """The figure that shows most: hunting if there is any, else the following error."""
    if "standstill_amplitude" in sweep.figures:
        amplitude = sweep.dataset["standstill_amplitude"].values
        peak = sweep.dataset["peak_error"].values
        hunts = np.isfinite(amplitude) & (amplitude > 0.1 * peak)
        return "standstill_amplitude" if hunts.any() else "peak_error"
    return sweep.figures[0]


def _lines(sweep: Sweep, names: Sequence[str]) -> Figure:
    """One panel per unit."""
    data = sweep.dataset
    if not names:
        names = [n for n in sweep.figures if data[n].attrs["unit"]]
    panels: dict[str, list[str]] = {}
    for name in names:
        panels.setdefault(sweep.unit(name), []).append(name)
    (axis,) = sweep.axes
    x, along = _axis(sweep, axis)
    parts = new_axes(len(panels), 7.0, 1.0 + 2.2 * len(panels))
    for part, (unit, group) in zip(parts, panels.items(), strict=True):
        shown = scale(unit, np.nan_to_num([data[name].values for name in group]))
        for number, name in enumerate(group, 1):
            y = shown(data[name].values)
            part.plot(x, y, marker=".", color=drive_colour(number), label=_words(name))
        part.set_ylabel(shown.label(""))
        part.legend()
        for lost in x[data["status"].values != "success"]:
            part.axvline(float(lost), color=LIMIT, lw=0.8, ls=":", zorder=0)
    parts[-1].set_xlabel(along)
    parts[0].set_title(f"{sweep.attributes['machine_name']}: {sweep.attributes['motion']}")
    return figure_of(parts[0])


def _map(sweep: Sweep, name: str) -> Figure:
    """The first axis to the right, the second upward."""
    across, up, *others = sweep.axes
    chosen: Any = sweep.dataset[name].isel(dict.fromkeys(others, 0))
    values = np.asarray(chosen.transpose(up, across).values, dtype=np.float64)
    shown = scale(sweep.unit(name), np.nan_to_num(values))
    (x, x_label), (y, y_label) = _axis(sweep, across), _axis(sweep, up)
    (part,) = new_axes(1, 7.0, 5.0)
    part.set_facecolor(BAND)
    order = np.ix_(np.argsort(y), np.argsort(x))
    mesh = part.pcolormesh(_edges(x), _edges(y), shown(values)[order], cmap="viridis")
    figure_of(part).colorbar(mesh, ax=part, label=shown.label(_words(name)))
    part.grid(visible=False)
    part.set(xlabel=x_label, ylabel=y_label)
    held = [f"{path} = {sweep.words(path, float(sweep.axes[path][0]))}" for path in others]
    part.set_title("; ".join([str(sweep.attributes["machine_name"]), *held]))
    return figure_of(part)


def _axis(sweep: Sweep, path: str) -> tuple[np.ndarray[Any, Any], str]:
    """Values as they are drawn, and the label."""
    values = sweep.axes[path]
    shown = scale(sweep.unit(path), values)
    return shown(values), shown.label(path)


def _edges(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Borders of cells half-way between rising values, shape (n + 1,).

    None is negative where no value is.
    """
    rising = np.sort(values)
    if len(rising) == 1:
        half = 0.5 * (abs(float(rising[0])) or 1.0)
        return np.array([rising[0] - half, rising[0] + half])
    middle = (rising[1:] + rising[:-1]) / 2
    first, last = 2 * rising[0] - middle[0], 2 * rising[-1] - middle[-1]
    if rising[0] >= 0:  # a gap, a tension: an axis below zero would show what there can't be
        first = max(first, 0.0)
    return np.concatenate([[first], middle, [last]])


def _words(name: str) -> str:
    return name.replace("_", " ").replace(".", " ").replace("rms", "RMS")
