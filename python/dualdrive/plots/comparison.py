"""A machine beside measured traces: both over time, and what is left between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.record import PlotError
from dualdrive.plots.style import (
    FIRST,
    LIMIT,
    MEASURED,
    MODEL,
    NOISE,
    figure_of,
    new_axes,
    picture,
    scale,
    single,
)
from dualdrive.plots.timeline import key_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.compare import Comparison, Condition, Quantity

__all__ = ["conditions", "measured_vs_model", "residuals"]

Array = NDArray[np.float64]

#: panels drawn unless channels are named
_MOST: Final = 6
_SHORT: Final = 64  # samples; fewer make no spectrum


@picture
def measured_vs_model(
    comparison: Comparison,
    channels: Sequence[str] | None = None,
    *,
    record: str | None = None,
    window: tuple[float, float] | None = None,
) -> Figure:
    """Measured and simulated over each other, one panel per channel, with the channel's error.

    channels: names; unless given, those that make the headline error
    record:   which record; the first unless given
    window:   (start, stop) in s; all of it unless given

    Raises PlotError for a channel or record that was not compared, or an empty window.
    """
    shown = _chosen(comparison, channels, record)
    panels = new_axes(len(shown), 8.5, 0.8 + 1.9 * len(shown))
    for axes, q in zip(panels, shown, strict=True):
        inside = _inside(q, window)
        unit = scale(q.unit, q.measured[inside])
        axes.plot(q.t[inside], unit(q.measured[inside]), color=MEASURED, lw=1.8, label="measured")
        axes.plot(
            q.t[inside], unit(q.simulated[inside]), color=MODEL, lw=1.2, ls="--", label="model"
        )
        axes.margins(y=0.08)
        axes.set_ylabel(unit.label(q.title))
        axes.set_title(_verdict(q), fontsize=9, fontweight="normal")
    key_above(panels[0])
    panels[-1].set_xlabel("time [s]")
    figure = figure_of(panels[0])
    figure.align_ylabels(panels)
    figure.suptitle(
        f"{comparison.machine} against {shown[0].record}",
        x=0.01,
        ha="left",
        fontsize=11,
        fontweight="bold",
    )
    return figure


@picture
def residuals(
    comparison: Comparison, channels: Sequence[str] | None = None, *, record: str | None = None
) -> Figure:
    """Simulated minus measured: over time, how it is spread, at which frequencies, and when.

    Beside each channel's residual stands its noise floor, where one is known; the spectrum of the
    residual stands before that of the signal. The last panel says under which conditions the error
    is larger than on average, all records together.

    channels: names; unless given, those that make the headline error
    record:   which record; the first unless given

    Raises PlotError for a channel or record that was not compared.
    """
    from matplotlib.figure import Figure

    shown = _chosen(comparison, channels, record)
    bars = [c for c in comparison.where if c.kind not in ("time", "order")]
    heights = [1.9 * len(shown), 0.7 + 0.24 * len(bars)] if bars else [1.9 * len(shown)]
    figure = Figure(figsize=(11.0, 0.6 + sum(heights)), layout="constrained")
    parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)
    above, *below = parts[:, 0]
    rows = above.subplots(len(shown), 3, squeeze=False, sharex="col", width_ratios=[3, 1, 1.5])
    for (over_time, spread, spectrum), q in zip(rows, shown, strict=True):
        _over_time(over_time, q)
        _spread(spread, q, over_time.get_ylim())
        _spectrum(spectrum, q)
    key_above(rows[0][0])
    key_above(rows[0][2])
    for axes, label in zip(
        rows[-1], ("time [s]", "share of the time", "frequency [Hz]"), strict=True
    ):
        axes.set_xlabel(label)
    above.align_ylabels(rows[:, 0])
    if bars:
        conditions(comparison, axes=below[0].subplots())
    figure.suptitle(
        f"{comparison.machine} minus {shown[0].record}",
        x=0.01,
        ha="left",
        fontsize=11,
        fontweight="bold",
    )
    return figure


class HasWhere(Protocol):
    """A comparison or a diagnosis."""

    @property
    def where(self) -> Sequence[Condition]:
        """Error under every condition."""


@picture
def conditions(comparison: HasWhere, *, axes: Axes | None = None) -> Figure:
    """How much larger the error is under each condition than on average, all records together.

    Coloured where it is larger beyond chance, or by a fifth where chance is not known.

    Raises PlotError where the comparison tells no conditions apart.
    """
    found = [c for c in comparison.where if c.kind not in ("time", "order")]
    if not found:
        raise PlotError("conditions: the error is the same everywhere, or there is none")
    axes = single(axes, 8.0, 0.9 + 0.3 * len(found))
    rows = np.arange(len(found))
    colours = [MODEL if _stands_out(c) else NOISE for c in found]
    axes.barh(rows, [c.excess for c in found], color=colours, height=0.7)
    for row, c in zip(rows, found, strict=True):
        text = f"×{c.excess:.2g} in {100 * c.time:.0f} % of the time"
        axes.text(
            1.0, float(row), text, va="center", ha="right", fontsize=8,
            transform=axes.get_yaxis_transform(),
        )  # fmt: skip
    axes.axvline(1.0, color=MEASURED, lw=0.9)
    axes.set_yticks(rows, [c.condition for c in found])
    axes.set_ylim(len(found) - 0.4, -0.6)
    axes.set_xlim(0, 1.35 * max(1.0, *(c.excess for c in found)))
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("RMS residual over that of the whole record [ratio]")
    return figure_of(axes)


def _stands_out(c: Condition) -> bool:
    return c.excess > 1.0 and c.significant if np.isfinite(c.p) else c.excess > 1.2


def _chosen(
    comparison: Comparison, channels: Sequence[str] | None, record: str | None
) -> list[Quantity]:
    record = comparison.records[0] if record is None else record
    own = [q for q in comparison.quantities if q.record == record]
    if not own:
        ways = ", ".join(comparison.records)
        raise PlotError(f"record {record!r}: not compared; the records are {ways}")
    if channels is None:
        return ([q for q in own if q.headline] or own)[:_MOST]
    named = {q.name: q for q in own}
    for name in channels:
        if name not in named:
            raise PlotError(f"channel {name!r}: not compared; there are {', '.join(named)}")
    return [named[name] for name in channels]


def _inside(q: Quantity, window: tuple[float, float] | None) -> NDArray[np.bool_]:
    low, high = window or (q.t[0], q.t[-1])
    inside = np.asarray((q.t >= low) & (q.t <= high))
    if inside.sum() < 2:
        rule = f"{inside.sum()} samples in {low:g} .. {high:g} s"
        raise PlotError(f"window: {rule}; it must hold two, within {q.t[0]:g} .. {q.t[-1]:g} s")
    return inside


def _verdict(q: Quantity) -> str:
    words = f"error {q.rms / q.spread:.3g} of the signal" if q.spread > 0 else "no signal"
    if np.isfinite(q.noise.rms) and q.spread > 0:
        words += f", noise floor {q.noise.rms / q.spread:.2g}"
    return words


def _over_time(axes: Axes, q: Quantity) -> None:
    unit = scale(q.unit, q.residual)
    if np.isfinite(q.noise.rms):
        edge = float(unit(q.noise.rms))
        axes.axhspan(-edge, edge, color=NOISE, lw=0, alpha=0.8, zorder=2.5, label="± noise floor")
    axes.plot(q.t, unit(q.residual), color=FIRST, lw=0.9)
    axes.axhline(0, color=LIMIT, lw=0.6)
    axes.margins(y=0.08)
    axes.set_ylabel(unit.label(q.title))
    axes.set_title(_verdict(q), fontsize=9, fontweight="normal")


def _spread(axes: Axes, q: Quantity, limits: tuple[float, float]) -> None:
    """How often the residual is how large, on the scale of the panel beside it."""
    left = scale(q.unit, q.residual)(q.residual[q.counted])
    bins = np.linspace(*limits, 61).tolist()
    axes.hist(
        left,
        bins=bins,
        orientation="horizontal",
        weights=np.full(len(left), 1 / len(left)),
        color=FIRST,
        alpha=0.6,
    )
    axes.set_ylim(limits)
    axes.tick_params(labelleft=False, labelbottom=False)
    axes.set_xticks([])
    axes.grid(visible=False, axis="x")


def _spectrum(axes: Axes, q: Quantity) -> None:
    """Amplitude densities of residual and signal; nothing for a record too short for them."""
    if len(q.t) < _SHORT:
        axes.set_axis_off()
        return
    unit = scale(q.unit, q.residual)
    for values, colour, label in (
        (q.measured, LIMIT, "signal"),
        (q.residual, FIRST, "residual"),
    ):
        frequency, density = _density(q.t, unit(values))
        axes.loglog(frequency, density, color=colour, lw=1.0, label=label)
    axes.margins(x=0)
    axes.set_ylabel(f"density [{unit.unit}/√Hz]")


def _density(t: Array, values: Array) -> tuple[Array, Array]:
    """Welch's estimate of the amplitude density on even steps; zero frequency left out."""
    from scipy.signal import welch

    even = np.linspace(t[0], t[-1], len(t))
    rate = (len(t) - 1) / float(t[-1] - t[0])
    span = min(len(t), max(_SHORT, len(t) // 4))
    frequency, power = welch(np.interp(even, t, values), rate, "hann", span)
    floor = np.finfo(np.float64).tiny
    return frequency[1:], np.sqrt(np.maximum(power[1:], floor))
