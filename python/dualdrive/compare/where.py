"""Where a machine fails: error under a condition over error everywhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: share of the largest speed below which the table counts as standing
STANDSTILL = 0.02
#: s on either side of a change of direction, a start or a stop that count as reversal, at most,
#: and of the time between two of them
REVERSAL, SHARE = 0.25, 0.1
WINDOWS = 12
_FEWEST = 0.01  # a condition met for less of the time says nothing


@dataclass(frozen=True)
class Condition:
    """Error under one condition.

    excess: RMS residual under it over RMS residual everywhere
    time:   its share of the record
    square: its share of the summed squares
    """

    kind: str
    condition: str
    excess: float
    time: float
    square: float


@dataclass(frozen=True, eq=False)
class Situation:
    """One record as the conditions see it; arrays of shape (n,).

    square: mean over the kinds of channel of squared residual over squared spread
    speed:  of the table, commanded where known
    flanks: mesh -> -1 back, 0 in the gap, 1 front
    """

    record: str
    t: Array
    square: Array
    speed: Array
    flanks: Mapping[str, Array]


def where_it_fails(situations: Sequence[Situation]) -> list[Condition]:
    """Excess under every condition that occurs, by kind; within a kind the worst first."""
    whole = np.concatenate([s.square for s in situations]) if situations else np.zeros(0)
    mean = float(np.mean(whole)) if len(whole) else 0.0
    if mean <= 0.0:
        return []
    flags = [_conditions(s, many=len(situations) > 1) for s in situations]
    found = []
    for key in dict.fromkeys(key for one in flags for key in one):
        inside = np.concatenate(
            [
                one.get(key, np.zeros(len(s.t), bool))
                for one, s in zip(flags, situations, strict=True)
            ]
        )
        time = float(np.mean(inside))
        if _FEWEST <= time < 1.0:
            part = float(np.mean(whole[inside]))
            found.append(Condition(*key, float(np.sqrt(part / mean)), time, part / mean * time))
    order = list(dict.fromkeys(c.kind for c in found))
    return sorted(found, key=lambda c: (order.index(c.kind), -c.excess))


def _conditions(s: Situation, *, many: bool) -> dict[tuple[str, str], Flags]:
    limit = STANDSTILL * float(np.max(np.abs(s.speed)))
    sign = np.where(np.abs(s.speed) <= limit, 0, np.sign(s.speed)).astype(int)
    found: dict[tuple[str, str], Flags] = {
        ("motion", "reversal"): (near := _near_changes(s.t, sign)),
        ("motion", "steady"): ~near & (sign != 0),
        ("motion", "standstill"): ~near & (sign == 0),
        ("direction", "forward"): sign > 0,
        ("direction", "backward"): sign < 0,
    }
    if s.flanks:
        contact = np.stack([np.asarray(f, dtype=int) for f in s.flanks.values()])
        drives = " and ".join(s.flanks)
        found[("flanks", f"{drives} braced")] = (contact.min(0) < 0) & (contact.max(0) > 0)
        found[("flanks", f"{drives} on one side")] = np.all(contact == contact[0], 0) & (
            contact[0] != 0
        )
        found[("flanks", "a flank open")] = np.any(contact == 0, 0)
    edges = np.linspace(s.t[0], s.t[-1], WINDOWS + 1)
    for low, high in pairwise(edges.tolist()):
        span = f"{low:.3g} .. {high:.3g} s"
        inside = (s.t >= low) & ((s.t < high) | (high == edges[-1]))
        found[("time", f"{s.record}: {span}" if many else span)] = inside
    return found


def _near_changes(t: Array, sign: NDArray[np.int64]) -> Flags:
    """Samples close to where the direction changes, starts and stops included."""
    changes = t[1:][np.diff(sign) != 0]
    if not len(changes):
        return np.zeros(len(t), dtype=bool)
    after = np.clip(np.searchsorted(changes, t), 0, len(changes) - 1)
    before = np.clip(after - 1, 0, None)
    distance = np.minimum(np.abs(t - changes[after]), np.abs(t - changes[before]))
    between = float(np.median(np.diff(np.concatenate([t[:1], changes, t[-1:]]))))
    near: Flags = distance <= min(REVERSAL, SHARE * between)
    return near


def standing(t: Array, reference: Array, settle: float = 0.5) -> Flags:
    """Samples at which the command has not moved for `settle` seconds, shape (n,)."""
    moves = t[1:][np.diff(reference) != 0.0]
    if not len(moves):
        return np.ones(len(t), dtype=bool)
    last = np.searchsorted(moves, t, side="right") - 1
    since = np.where(last >= 0, t - moves[np.maximum(last, 0)], t - t[0])
    still: Flags = since > settle
    return still
