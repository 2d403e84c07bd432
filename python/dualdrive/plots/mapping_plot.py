"""The channels of a recording as a proposed mapping reads them, and the columns it leaves out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.style import COMMAND, LIMIT, TABLE, drive_colour, picture, scale
from dualdrive.units import conversion

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.traces import ColumnGuess, Proposal, Trace

__all__ = ["mapping"]

Array = NDArray[np.float64]

#: a kind of channel -> how its names begin
_KINDS: Final = {"angle": "theta_", "speed": "omega_", "torque": "T_", "current": "I_",
                 "voltage": "U_"}  # fmt: skip
_ACROSS: Final = 4  # small pictures of what is left out
_MOST: Final = 24
_LINES: Final = (1.9, 0.9)  # points, the first line and the last
_WIDTH, _HEIGHT, _SMALL, _LABELS = 10.0, 1.9, 1.05, 0.4  # inches


@picture
def mapping(proposal: Proposal) -> Figure:
    """Mapped channels by kind and place, each named after its column; below, small, the others.

    Raises TraceError where the recording can't be read with the proposal.
    """
    from matplotlib.figure import Figure

    trace = proposal.trace()
    columns = {guess.channel: guess.column for guess in proposal.columns if guess.channel}
    panels = _panels(columns)
    left = [guess for guess in proposal.unmapped if _changes(trace, guess)]
    rows = -(-min(len(left), _MOST) // _ACROSS)
    # a title and an axis label come to each part
    heights = [h for h in (_HEIGHT * len(panels), _SMALL * rows) if h]
    heights = [h + _LABELS for h in heights or [_HEIGHT]]
    figure = Figure(figsize=(_WIDTH, sum(heights)), layout="constrained")
    parts = iter(figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0])
    if panels:
        axes = next(parts).subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for panel, (kind, own) in zip(axes, panels.items(), strict=True):
            _draw(panel, trace, kind, {name: columns[name] for name in own})
        axes[-1].set_xlabel("time [s]")
        axes[0].set_title(f"{proposal.path.name}: channels as proposed")
    if rows:
        part = next(parts)
        _left_out(part.subplots(rows, _ACROSS, sharex=True, squeeze=False), trace, left)
        more = f", and {len(left) - _MOST} more" if len(left) > _MOST else ""
        part.suptitle(f"not mapped, in their own units{more}", x=0.01, ha="left", size=9)
    return figure


def _panels(channels: Iterable[str]) -> dict[str, list[str]]:
    """What shares an axis -> its channels: table, pinions and motors are geared, and never do."""
    found: dict[str, list[str]] = {}
    for kind, stem in _KINDS.items():
        places: dict[str, list[str]] = {}
        for name in channels:
            if name.startswith(stem):
                places.setdefault(_place(name.removeprefix(stem)), []).append(name)
        alone = len(places) == 1
        found |= {kind if alone else f"{place} {kind}": own for place, own in places.items()}
    return found


def _place(end: str) -> str:
    """Where a channel is, by the end of its name."""
    if end in ("m", "ref", "load"):
        return "table"
    return "pinion" if end.startswith("c") else "motor"


def _draw(axes: Axes, trace: Trace, kind: str, columns: dict[str, str]) -> None:
    values = np.concatenate([trace[name] for name in columns])
    unit = scale(trace.units[next(iter(columns))], values)
    ordered = sorted(columns.items(), key=lambda pair: pair[0].endswith("_ref"))
    widths = np.linspace(*_LINES, len(ordered))  # so that one line does not hide another
    for width, (name, column) in zip(widths, ordered, strict=True):
        label = name if column == name else f"{name} ← {column}"
        t, y = _broken(trace, trace[name])
        style = (0, (4, 2)) if name.endswith("_ref") else "-"
        axes.plot(t, unit(y), color=_colour(name), ls=style, lw=width, label=label)
    axes.set_ylabel(unit.label(kind))
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _colour(name: str) -> str:
    if name.endswith("_ref"):
        return COMMAND
    return drive_colour(int(name[-1])) if name[-1] in "12" else TABLE


def _broken(trace: Trace, values: Array) -> tuple[Array, Array]:
    """Times and values with a gap where the recording pauses."""
    at = np.asarray(trace.breaks, dtype=np.int64)
    return np.insert(trace.t, at, np.nan), np.insert(values, at, np.nan)


def _changes(trace: Trace, guess: ColumnGuess) -> bool:
    """Whether there is anything to see; a constant is told in words."""
    return guess.column in trace and bool(np.ptp(trace[guess.column]) > 0)


def _left_out(grid: NDArray[Any], trace: Trace, left: list[ColumnGuess]) -> None:
    for axes, guess in zip(grid.flat, left, strict=False):
        t, y = _broken(trace, trace[guess.column])
        title, unit = guess.column, trace.units[guess.column]
        if guess.unit:
            factor, zero = conversion(guess.unit, unit)
            y, title = (y - zero) / factor, f"{title} [{guess.unit}]"
        axes.plot(t, y, color=LIMIT, lw=0.8)
        axes.set_title(title, fontsize=7, fontweight="normal", pad=2)
        axes.tick_params(labelsize=6)
    for axes in grid.flat[len(left) :]:
        axes.set_axis_off()
