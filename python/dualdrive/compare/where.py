"""Where a machine fails: error under a condition over error everywhere, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.conditions import Bands, conditions
from dualdrive.compare.significance import adjusted

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_FEWEST = 0.01  # a condition met for less of the time says nothing
_SETTLE = 0.5  # s after the command has stopped: then a machine stands
#: chance of naming any condition at all where none is worse than the others
LEVEL = 0.01


@dataclass(frozen=True)
class Condition:
    """Error under one condition.

    kind:   motion, direction, speed, torque, flanks, time; ``order`` for a line in the spectrum of
            the residual over an angle
    excess: RMS residual under it over RMS residual everywhere; of a line, its amplitude over what
            its neighbours would have
    time:   its share of the record
    square: its share of the summed squares
    p:      probability of so large an excess anywhere, were the error alike under all conditions;
            NaN where it can't be told
    """

    kind: str
    condition: str
    excess: float
    time: float
    square: float
    p: float = float("nan")

    @property
    def significant(self) -> bool:
        """Whether the error is larger here than elsewhere, beyond chance."""
        return self.p <= LEVEL


@dataclass(frozen=True, eq=False)
class Situation:
    """One record as the conditions see it; arrays of shape (n,).

    square: mean over the kinds of channel of squared residual over squared spread
    speed:  of the table, commanded where known
    flanks: mesh -> -1 back, 0 in the gap, 1 front
    load:   sum of the motors' torques or currents, absolute; None where none is recorded
    counts: samples that count; all unless told
    """

    record: str
    t: Array
    square: Array
    speed: Array
    flanks: Mapping[str, Array] = field(default_factory=dict)
    load: Array | None = None
    counts: Flags | None = None


def where_it_fails(situations: Sequence[Situation]) -> list[Condition]:
    """Excess under every condition that occurs, by kind; within a kind the worst first.

    Residuals resemble their neighbours, so the p-values come from permuted blocks, and hold for
    the worst of all conditions together (:mod:`dualdrive.compare.significance`).
    """
    situations = [_counted(s) for s in situations]
    whole = np.concatenate([s.square for s in situations]) if situations else np.zeros(0)
    mean = float(np.mean(whole)) if len(whole) else 0.0
    if mean <= 0.0:
        return []
    bands = Bands.of([s.speed for s in situations], [s.load for s in situations])
    flags = [conditions(s, bands, many=len(situations) > 1) for s in situations]
    inside: dict[tuple[str, str], list[Flags]] = {}
    for key in dict.fromkeys(key for one in flags for key in one):
        own = [
            one.get(key, np.zeros(len(s.t), bool)) for one, s in zip(flags, situations, strict=True)
        ]
        if _FEWEST <= np.mean(np.concatenate(own)) < 1.0:
            inside[key] = own
    chance = adjusted([s.square for s in situations], inside)
    found = []
    for key, own in inside.items():
        flag = np.concatenate(own)
        time, part = float(np.mean(flag)), float(np.mean(whole[flag]))
        excess = float(np.sqrt(part / mean))
        found.append(Condition(*key, excess, time, part / mean * time, chance[key]))
    order = list(dict.fromkeys(c.kind for c in found))
    return sorted(found, key=lambda c: (order.index(c.kind), -c.excess))


def _counted(s: Situation) -> Situation:
    """The samples that count, end to end."""
    if s.counts is None or s.counts.all():
        return s
    rows = s.counts
    load = None if s.load is None else s.load[rows]
    flanks = {mesh: f[rows] for mesh, f in s.flanks.items()}
    return Situation(s.record, s.t[rows], s.square[rows], s.speed[rows], flanks, load)


def standing(t: Array, reference: Array) -> Flags:
    """Samples at which the command has not moved for half a second, shape (n,)."""
    moves = t[1:][np.diff(reference) != 0.0]
    if not len(moves):
        return np.ones(len(t), dtype=bool)
    last = np.searchsorted(moves, t, side="right") - 1
    since = np.where(last >= 0, t - moves[np.maximum(last, 0)], t - t[0])
    still: Flags = since > _SETTLE
    return still
