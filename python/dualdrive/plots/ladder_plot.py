"""How the error falls: nominal machine, refitted, one effect more, and so on."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.record import PlotError
from dualdrive.plots.style import FIRST, MEASURED, SECOND, figure_of, picture, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

__all__ = ["LadderStep", "Step", "ladder"]


class LadderStep(Protocol):
    """What `ladder` reads of a step: errors are RMS residual over RMS signal."""

    @property
    def label(self) -> str:
        """What was done: ``nominal``, ``refitted``, ``+ coulomb@table``."""

    @property
    def fitted(self) -> float:
        """Error on the records the fit saw."""

    @property
    def held_out(self) -> float | None:
        """Error on records it did not see; None or NaN where there are none."""


class Step(NamedTuple):
    """A step of the ladder as plain numbers."""

    label: str
    fitted: float
    held_out: float | None = None


@picture
def ladder(
    steps: Sequence[LadderStep], *, noise_floor: float | None = None, axes: Axes | None = None
) -> Figure:
    """Error after each step, on the fitted and on the held-out records, down to the noise floor.

    steps:       in the order they were taken; errors are RMS residual over RMS signal
    noise_floor: the error that a perfect model would leave; not drawn where it is not known

    Raises PlotError where there is no step, or an error is not a positive number.
    """
    if not steps:
        raise PlotError("ladder: no step given")
    axes = single(axes, max(5.0, 1.6 + 1.3 * len(steps)), 3.8)
    series = {"fitted records": [s.fitted for s in steps]}
    if all(s.held_out is not None and np.isfinite(s.held_out) for s in steps):
        series["held-out records"] = [float(s.held_out or 0.0) for s in steps]
    for name, values in series.items():
        for step, value in zip(steps, values, strict=True):
            if not (np.isfinite(value) and value > 0):
                raise PlotError(f"ladder: {step.label!r}, {name}: error {value} must be above 0")
    places = np.arange(len(steps), dtype=np.float64)
    looks = (
        {"color": FIRST, "marker": "o", "ls": "-"},
        {"color": SECOND, "marker": "s", "ls": "--"},
    )
    for (name, values), look in zip(series.items(), looks, strict=False):
        axes.plot(places, 100 * np.array(values), ms=5, label=name, **look)  # type: ignore[arg-type]
    _numbers(axes, places, list(series.values()))
    if noise_floor is not None and not (np.isfinite(noise_floor) and noise_floor > 0):
        noise_floor = None
    if noise_floor is not None:
        axes.axhspan(0, 100 * noise_floor, color="#EDEFF0", lw=0, zorder=0)
        axes.axhline(100 * noise_floor, color=MEASURED, lw=1.0, ls=":", label="noise floor")
    axes.set_yscale("log")
    _decades(axes, [*chain(*series.values()), noise_floor or steps[-1].fitted])
    axes.set_xticks(places, [_wrapped(step.label) for step in steps])
    axes.set_xlim(-0.5, len(steps) - 0.5)
    axes.grid(visible=False, axis="x")
    axes.set_ylabel("RMS residual [% of the signal]")
    axes.set_title("Error ladder")
    axes.legend(loc="upper right")
    return figure_of(axes)


def _wrapped(label: str) -> str:
    """A label on several lines: an effect and its place are long beside each other."""
    from textwrap import wrap

    return "\n".join(wrap(label.replace("@", " @"), 18)).replace(" @", "@")


def _numbers(axes: Axes, places: Array, series: list[list[float]]) -> None:
    """The larger value of a step to the upper right, the smaller to the lower left."""
    for at, values in zip(places, zip(*series, strict=True), strict=True):
        for k, value in enumerate(sorted(values, reverse=True)):
            axes.annotate(
                f"{100 * value:.3g} %", (at, 100 * value), (5, 5) if k == 0 else (-5, -5),
                textcoords="offset points", fontsize=8,
                ha="left" if k == 0 else "right", va="bottom" if k == 0 else "top",
            )  # fmt: skip


def _decades(axes: Axes, values: list[float]) -> None:
    """Plain numbers on the logarithmic axis, and room for the labels."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(100 * min(values) / 1.6, 100 * max(values) * 1.6)
