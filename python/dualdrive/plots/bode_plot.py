"""Frequency responses as Bode plots: magnitude in dB, phase in degrees, over Hz."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dualdrive.plots.record import PlotError
from dualdrive.plots.style import (
    BAND,
    LIMIT,
    MEASURED,
    TABLE,
    drive_colour,
    figure_of,
    new_axes,
    picture,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.linear import DriveComparison, FrequencyResponse, Margins

__all__ = ["bode", "drives"]

_POINTS: Final[dict[str, dict[str, Any]]] = {
    "model": {"ls": "-"},
    "simulated": {"ls": "", "marker": "o", "ms": 4, "mfc": "none"},
    "measured": {"ls": "", "marker": ".", "ms": 4, "color": MEASURED},
}
_LEAST: Final = 1e-6  # of distortion, that is drawn


@picture
def bode(
    *responses: FrequencyResponse,
    labels: Sequence[str] | None = None,
    margins: Margins | None = None,
    title: str = "",
) -> Figure:
    """Responses over each other: lines for models, rings for simulated, dots for measured ones.

    margins: of the first response, read as an open loop; marked where they are

    A third panel shows distortion and what is missing to a coherence of 1, where there are any.
    Raises PlotError when no response is given.
    """
    if not responses:
        raise PlotError("bode: nothing to draw; give at least one frequency response")
    quality = [r for r in responses if r.distortion is not None or r.coherence is not None]
    panels = new_axes(3 if quality else 2, 8.0, 7.0 if quality else 5.6)
    for k, response in enumerate(responses):
        look = {"color": drive_colour(k + 1), **_POINTS[response.origin]}
        label = labels[k] if labels else _label(response)
        panels[0].plot(response.frequency_hz, response.magnitude_db, label=label, **look)
        panels[1].plot(response.frequency_hz, _near_zero(response.phase_deg), **look)
    if margins is not None:
        _mark(panels[0], panels[1], margins)
    for response in quality:
        _quality(panels[2], response)
    units = list(dict.fromkeys(r.unit for r in responses))
    panels[0].set_ylabel(
        f"magnitude [dB{f' of {units[0]}' if units[0] and len(units) == 1 else ''}]"
    )
    panels[1].set_ylabel("phase [deg]")
    panels[1].yaxis.set_major_locator(_degrees(panels[1]))
    panels[0].legend(loc="best")
    panels[0].set_title(title or _title(responses))
    _frequencies(panels, responses)
    return figure_of(panels[0])


@picture
def drives(comparison: DriveComparison, title: str = "") -> Figure:
    """Both drives' responses, and their difference with what counts as alike."""
    panels = new_axes(4, 8.0, 8.4, [3, 2, 1.4, 1.4])
    for k, (name, response) in enumerate(
        (("master", comparison.master), ("slave", comparison.slave))
    ):
        look: dict[str, Any] = {"color": drive_colour(k + 1), "lw": 2.4 - 1.2 * k}
        panels[0].plot(response.frequency_hz, response.magnitude_db, label=name, **look)
        panels[1].plot(response.frequency_hz, _near_zero(response.phase_deg), **look)
    f = comparison.master.frequency_hz
    for axes, values, tolerance, unit in (
        (panels[2], comparison.difference_db, comparison.tolerance_db, "dB"),
        (panels[3], comparison.difference_deg, comparison.tolerance_deg, "deg"),
    ):
        axes.axhspan(-tolerance, tolerance, color=BAND, lw=0)
        axes.plot(f, np.where(comparison.counts, values, np.nan), color=MEASURED)
        widest = 1.2 * max(float(np.abs(values[comparison.counts]).max()), 1.5 * tolerance)
        axes.set_ylim(-widest, widest)
        axes.set_ylabel(f"difference [{unit}]")
    if comparison.frequency_hz is not None:
        for axes in panels:
            axes.axvline(comparison.frequency_hz, color=LIMIT, ls="--", lw=0.9)
    panels[0].set_ylabel("magnitude [dB]")
    panels[1].set_ylabel("phase [deg]")
    panels[1].yaxis.set_major_locator(_degrees(panels[1]))
    panels[0].legend(loc="best")
    panels[0].set_title(title or "Speed set-point to speed, both drives")
    _frequencies(panels, (comparison.master,))
    return figure_of(panels[0])


def _label(response: FrequencyResponse) -> str:
    """What is drawn; what an open loop was cut at is both its input and its output."""
    if response.input == response.output:
        return f"open loop, cut at {response.input}"
    return f"{response.output} / {response.input}, {response.origin}"


def _title(responses: Sequence[FrequencyResponse]) -> str:
    first = responses[0]
    if first.input == first.output:
        return f"Open loop, cut at {first.input}"
    return f"{first.output} over {first.input}"


def _near_zero(phase: Any) -> Any:
    """A continuous phase that begins between -360 and 0 deg, where loops are read."""
    return phase - 360 * np.ceil((phase[0] - 1) / 360)


def _degrees(axes: Axes) -> Any:
    """Ticks every 45 deg, or more where that would be many."""
    from matplotlib.ticker import MultipleLocator

    low, high = axes.get_ylim()
    step = next((s for s in (15, 45, 90, 180, 360) if (high - low) / s <= 7), 720)
    return MultipleLocator(step)


def _mark(size: Axes, phase: Axes, margins: Margins) -> None:
    """Where the margins are taken, and how large they are."""
    for axes, level in ((size, 0.0), (phase, -180.0)):
        axes.axhline(level, color=LIMIT, lw=0.9)
    for f, what in (
        (margins.phase_hz, f"{margins.phase_deg:.0f} deg" if margins.phase_deg is not None else ""),
        (margins.gain_hz, f"{margins.gain_db:.1f} dB" if margins.gain_db is not None else ""),
    ):
        if f is None:
            continue
        for axes in (size, phase):
            axes.axvline(f, color=TABLE, ls="--", lw=0.9)
        size.annotate(
            what, (f, 1.0), (3, -3), xycoords=("data", "axes fraction"),
            textcoords="offset points", va="top", color=TABLE,
        )  # fmt: skip


def _quality(axes: Axes, response: FrequencyResponse) -> None:
    """Distortion and lack of coherence on one logarithmic scale."""
    f = response.frequency_hz
    if response.distortion is not None:
        axes.plot(f, np.maximum(response.distortion, _LEAST), "s-", ms=3, label="harmonics")
    if response.coherence is not None:
        lack = np.clip(1 - response.coherence, _LEAST, 1)
        axes.plot(f, lack, ".--", ms=3, color=MEASURED, label="1 - coherence")
    axes.set_yscale("log")
    axes.set_ylim(_LEAST / 2, 2)
    axes.set_ylabel("share [1]")
    axes.legend(loc="best")


def _frequencies(panels: Sequence[Axes], responses: Sequence[FrequencyResponse]) -> None:
    found = [r for r in responses if r.origin != "model"]
    room = 3.0 if found else 1.05  # a model reaches further than anything measured
    low = min(r.frequency_hz[0] for r in found or responses) / room
    high = max(r.frequency_hz[-1] for r in found or responses) * room
    for axes in panels:
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        axes.margins(y=0.06)
    panels[-1].set_xlabel("frequency [Hz]")
