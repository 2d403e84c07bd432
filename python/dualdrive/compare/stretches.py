"""The stretches of a record in which a machine fails, each with the condition that they share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.comparing import _balance_situation, _situation
from dualdrive.compare.comparison import Comparison
from dualdrive.compare.conditions import Bands, Flags, conditions
from dualdrive.compare.where import Condition, Situation
from dualdrive.identify import Evaluation
from dualdrive.traces import Trace

__all__ = ["Stretch", "failing_stretches", "situations_of"]

Array = NDArray[np.float64]

#: excess from which a condition counts where chance is not known, as in `Comparison.remarks`
_LARGER = 1.2


@dataclass(frozen=True, eq=False)
class Stretch:
    """The intervals of one record under one condition.

    kind, condition, excess: of the :class:`Condition`
    sure:      the excess is beyond chance
    intervals: start and stop in s, shape (k, 2)
    """

    record: str
    kind: str
    condition: str
    excess: float
    sure: bool
    intervals: Array


def situations_of(
    comparison: Comparison, found: Evaluation | None, traces: Mapping[str, Trace]
) -> list[Situation]:
    """What decides the conditions, per record (in a balance per record and equation).

    found: the evaluation behind the comparison of a closed loop; None in a torque balance
    """
    if found is None:
        return [_balance_situation(traces[q.record], q) for q in comparison.quantities]
    situations = []
    for replay in found.replays:
        own = [q for q in comparison.quantities if q.record == replay.record.name]
        situations.append(_situation(replay.record, own, replay.flanks))
    return situations


def failing_stretches(
    comparison: Comparison, situations: Sequence[Situation], most: int = 400
) -> list[Stretch]:
    """Where each condition holds under which the error is larger than on average, worst first.

    most: intervals of one condition and record; the longest are kept
    """
    bands = Bands.of([s.speed for s in situations], [s.load for s in situations])
    many = len(situations) > 1
    flags = [(s, conditions(s, bands, many=many)) for s in situations]
    found = []
    for c in sorted(comparison.where, key=lambda c: (not _sure(c), -c.excess)):
        if c.excess <= 1.0 or c.kind == "order":
            continue
        seen = set[str]()
        for s, own in flags:
            inside = own.get((c.kind, c.condition))
            if inside is None or not inside.any() or s.record in seen:
                continue
            seen.add(s.record)
            spans = _intervals(s.t, inside, most)
            found.append(Stretch(s.record, c.kind, c.condition, c.excess, _sure(c), spans))
    return found


def _sure(c: Condition) -> bool:
    return c.significant if math.isfinite(c.p) else c.excess > _LARGER


def _intervals(t: Array, inside: Flags, most: int) -> Array:
    """Start and stop of every run of flagged samples, shape (k, 2); the longest if too many."""
    steps = np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8))
    starts, stops = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1
    spans = np.column_stack([t[starts], t[stops]])
    if len(spans) > most:
        longest = np.argsort(spans[:, 0] - spans[:, 1], kind="stable")[:most]
        spans = spans[np.sort(longest)]
    return np.asarray(spans, dtype=np.float64)
