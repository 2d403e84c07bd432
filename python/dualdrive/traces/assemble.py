"""From channels with holes and wraps to a trace: fill, cut at pauses, mend angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .angles import mend_angles
from .channels import Channel
from .log import Recorder
from .mapping import TimeRule
from .missing import fill_missing
from .rates import note_rates
from .segments import find_gaps, gap_limit, note_jitter
from .table import Table
from .trace import Trace

__all__ = ["assemble"]

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


def assemble(
    name: str,
    table: Table,
    seconds: Floats,
    set_back: list[int],
    channels: list[Channel],
    rule: TimeRule,
    recorder: Recorder,
) -> Trace:
    """Make the trace. `set_back` are the rows at which the clock was set back."""
    limit = gap_limit(seconds, rule)
    usable = fill_missing(channels, seconds, limit, table.rows, recorder)
    run = np.zeros(len(seconds), dtype=np.int64)
    run[set_back] = 1
    run = np.cumsum(run)
    usable = _without_lone(seconds, run, usable, limit, table.rows, recorder)
    t, rows, run = seconds[usable], table.rows[usable], run[usable]
    if len(t) < 2:
        raise recorder.error("file", "fewer than two usable rows", "record for longer", rows)
    gaps = find_gaps(t, limit)
    if gaps.size:
        longest = np.diff(t).max()
        recorder.add("gap", f"a new segment begins; longest pause {longest:.4g} s", rows[gaps])
    note_jitter(t, rows, limit, recorder)
    breaks = set(gaps.tolist()) | set((np.flatnonzero(np.diff(run)) + 1).tolist())
    for channel in channels:
        channel.values = channel.values[usable]
        pauses = np.array(sorted(breaks), dtype=np.int64)
        breaks |= set(mend_angles(channel, rows, pauses, recorder))
    _note_stale(channels, rows, recorder)
    values = {channel.name: channel.values for channel in channels}
    note_rates(t, values, np.array(sorted(breaks), dtype=np.int64), recorder)
    return Trace(
        t=t,
        channels=values,
        units={channel.name: channel.unit for channel in channels},
        long_names={channel.name: channel.long_name for channel in channels},
        name=name,
        constants=table.constants,
        rows=rows,
        breaks=tuple(sorted(breaks)),
    )


def _without_lone(
    seconds: Floats,
    run: Indices,
    usable: NDArray[np.bool_],
    limit: float,
    rows: Indices,
    recorder: Recorder,
) -> NDArray[np.bool_]:
    """Leave out single rows between two pauses: nothing can be computed from them."""
    index = np.flatnonzero(usable)
    if len(index) < 2:
        return usable
    new = np.concatenate([[True], (np.diff(seconds[index]) > limit) | (np.diff(run[index]) != 0)])
    lone = index[new & np.append(new[1:], True)]
    if lone.size:
        recorder.add("lone_row", "single rows between pauses left out", rows[lone])
        usable = usable.copy()
        usable[lone] = False
    return usable


def _note_stale(channels: list[Channel], rows: Indices, recorder: Recorder) -> None:
    """Name rows that repeat every channel although at least three were moving before and after.

    One channel may well repeat a value; a recorder that was late writes all of them again.
    """
    known = [channel.values for channel in channels if not channel.is_extra]
    if len(known) < 3 or len(rows) < 4:
        return
    moved = np.array([np.diff(values) != 0 for values in known])
    around = np.sum(moved[:, :-2] & moved[:, 2:], axis=0)
    still = np.sum(moved, axis=0)[1:-1] == 0
    stale = np.flatnonzero(still & (around >= 3)) + 2
    if stale.size:
        recorder.add("stale", "the row before written again; kept", rows[stale])
