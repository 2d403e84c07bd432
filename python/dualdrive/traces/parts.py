"""Cutting a trace at changes of its settings, and differences of its angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .log import Issue, Log, TraceError, row_ranges
from .mapping_file import duration

if TYPE_CHECKING:
    from .trace import Trace

__all__ = ["difference", "split"]


def split(trace: Trace, by: Sequence[str], settle: float, min_time: float) -> list[Trace]:
    """See `Trace.split`."""
    rule = trace.source.mapping.get("split", {})
    if not by:
        by = rule.get("by", ())
        settle = settle or (duration(rule["settle"], "split.settle") if "settle" in rule else 0.0)
        least = duration(rule["min_time"], "split.min_time") if "min_time" in rule else 0.0
        min_time = min_time or least
    if not by:
        return [trace]
    settings = {name: trace[_channel(trace, name)] for name in by}
    changed = np.zeros(len(trace), dtype=bool)
    for values in settings.values():
        changed[1:] |= np.diff(values) != 0
    edges = [0, *np.flatnonzero(changed).tolist(), len(trace)]
    parts: list[Trace] = []
    left_out: list[int] = []
    for start, stop in pairwise(edges):
        settled = int(np.searchsorted(trace.t, trace.t[start] + settle)) if settle else start
        if settled >= stop or trace.t[stop - 1] - trace.t[settled] < min_time:
            left_out += trace.rows[start:stop].tolist()
            continue
        left_out += trace.rows[start:settled].tolist()
        labels = {name: float(values[start]) for name, values in settings.items()}
        parts.append(replace(trace.take(slice(settled, stop)), labels={**trace.labels, **labels}))
    if not parts:
        message = f"{trace.name}: every part is shorter than {min_time:g} s; lower min_time"
        raise TraceError(message, kind="short_part", rows=left_out)
    return _name(trace, parts, left_out)


def _channel(trace: Trace, name: str) -> str:
    """The channel a column of the file became."""
    rule = trace.source.mapping.get("columns", {}).get(name, {})
    return name if name in trace.channels else rule.get("channel", name)


def _name(trace: Trace, parts: list[Trace], left_out: list[int]) -> list[Trace]:
    """Name parts by what sets them apart, and tell each what became of the rows between them."""
    issue = Issue("short_part", f"not in any part: {row_ranges(left_out)}")
    note = (issue,) if left_out else ()
    differing = [n for n in parts[0].labels if len({part.labels[n] for part in parts}) > 1]
    seen: dict[str, int] = {}
    named = []
    for part in parts:
        settings = ", ".join(f"{n}={part.labels[n]:g}" for n in differing or part.labels)
        name = f"{trace.name}[{settings}]"
        seen[name] = seen.get(name, 0) + 1
        name += f" #{seen[name]}" if seen[name] > 1 else ""
        named.append(replace(part, name=name, log=Log((*part.log, *note))))
    return named


def difference(
    trace: Trace, first: str, second: str, ratio: float, turn: float | None
) -> NDArray[np.float64]:
    """See `Trace.difference`."""
    if trace.units.get(first) != trace.units.get(second):
        units = f"{trace.units.get(first)} and {trace.units.get(second)}"
        if first in trace and second in trace:
            message = f"{trace.name}: {first} and {second} are in {units}; convert one of them"
            raise TraceError(message, kind="unit")
    apart = trace[first] - ratio * trace[second]
    if turn is None:
        return apart
    edges = [0, *trace.breaks, len(trace)]
    for start, stop in pairwise(edges):
        piece = np.unwrap(apart[start:stop], period=turn)
        apart[start:stop] = piece - turn * np.round(piece[0] / turn)
    return apart
