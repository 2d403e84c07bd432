"""Empty cells: leave the row out, interpolate over them, or hold the value before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .channels import Channel
from .log import Recorder

__all__ = ["fill_missing"]

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


def fill_missing(
    channels: list[Channel],
    t: Floats,
    limit: float,
    rows: NDArray[np.int64],
    recorder: Recorder,
) -> Mask:
    """Fill what the mapping wants filled and return the rows that can be used.

    limit: longest time in s over which a value may be interpolated or held in a channel; a longer
           hole leaves its rows out. Extra channels hold their value however long, since they are
           often settings that are written only when they change.
    """
    empty = {c.column: np.isnan(c.values) for c in channels}
    holed = [c for c in channels if empty[c.column].any()]
    dropping = [c for c in holed if _way(c) == "drop"]
    filling = [c for c in holed if _way(c) != "drop"]
    usable = np.ones(len(t), dtype=bool)
    for channel in dropping:
        usable &= ~empty[channel.column]
    too_long = {c.column: _too_long(c, t, empty[c.column], limit) for c in filling}
    for channel in filling:
        usable &= ~too_long[channel.column]
    if 2 * np.count_nonzero(usable) < len(t):
        worst = max(holed, key=lambda c: np.count_nonzero(empty[c.column]))
        lost = np.count_nonzero(~usable)
        rule = f"{lost} of {len(t)} rows lack a value, most in {worst.column!r}"
        way_out = 'set missing = "interpolate" for it, or list it in [file] ignore'
        raise recorder.error("missing", rule, way_out, rows[~usable])
    if dropping:
        mask = np.any([empty[c.column] for c in dropping], axis=0)
        names = ", ".join(c.column for c in dropping)
        recorder.add("missing", f"{names}: rows left out", rows[mask])
    for channel in filling:
        _fill(channel, t, empty[channel.column], too_long[channel.column], usable, rows, recorder)
    return usable


def _way(channel: Channel) -> str:
    return channel.rule.missing or ("hold" if channel.is_extra else "drop")


def _too_long(channel: Channel, t: Floats, empty: Mask, limit: float) -> Mask:
    if channel.is_extra and _way(channel) == "hold":
        return np.zeros_like(empty)
    return _beyond(t, empty, limit)


def _fill(
    channel: Channel,
    t: Floats,
    empty: Mask,
    too_long: Mask,
    usable: Mask,
    rows: NDArray[np.int64],
    recorder: Recorder,
) -> None:
    """Give every empty cell a number, and name those that stay in the trace."""
    if _way(channel) == "interpolate":
        channel.values = np.interp(t, t[~empty], channel.values[~empty])
        words = "interpolated"
    else:
        channel.values = _held(channel.values, empty)
        words = "value before held"
    if (filled := empty & usable).any():
        recorder.add("missing", f"{channel.column}: {words}", rows[filled])
    if too_long.any():
        recorder.add("missing", f"{channel.column}: hole too long, rows left out", rows[too_long])


def _beyond(t: Floats, empty: Mask, limit: float) -> Mask:
    """Empty samples at an end, or in a hole that takes longer than `limit`."""
    known = np.flatnonzero(~empty)
    index = np.arange(len(t))
    after = np.searchsorted(known, index)
    inside = (after > 0) & (after < len(known))
    left = t[known[np.clip(after - 1, 0, len(known) - 1)]]
    right = t[known[np.clip(after, 0, len(known) - 1)]]
    return empty & (~inside | (right - left > limit))


def _held(values: Floats, empty: Mask) -> Floats:
    """Each empty sample takes the value before it; leading ones take the first."""
    last = np.maximum.accumulate(np.where(empty, -1, np.arange(len(values))))
    first = int(np.argmax(~empty))
    return values[np.where(last < 0, first, last)]
