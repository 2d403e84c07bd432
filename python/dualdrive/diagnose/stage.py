"""A machine as it was refitted, with the effects that it has, on which others are tried.

Their signatures are taken about that machine, and scored beside its nuisances and the numbers of
its own effects: what it leaves is what they are for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.floors import heard_above
from dualdrive.diagnose.hypotheses import Hypothesis, distinct
from dualdrive.diagnose.laws import carrier
from dualdrive.diagnose.orders import (
    HIGHEST,
    LOW,
    members_of,
    strongest_orders,
    travel_of,
)
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.score import Gain, Scorer
from dualdrive.diagnose.signatures import Prober, Signature
from dualdrive.diagnose.spots import TRIED, worst_spot
from dualdrive.diagnose.work import Work

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scale:
    """One description of the noise by which gains are weighed, and what they are divided by."""

    evidence: Evidence
    scorer: Scorer
    over: float = 1.0

    @property
    def rest(self) -> Array:
        """White rows of what the machine leaves, the nuisances' share removed, (n,)."""
        return self.scorer.rest(self.scorer.rows.left[:, None])[:, 0]

    def gain(self, signature: Signature) -> Gain:
        """What a signature gains."""
        return self.scorer(self.evidence.white(signature.columns))


def scale_of(seen: Evidence, refit: Refit, over: float = 1.0) -> Scale:
    """For what is tried beside a refit, whose own numbers move with the nuisances."""
    return Scale(seen, scorer_of(seen, refit.u, refit.left, refit.slopes, refit.columns), over)


def scorer_of(
    seen: Evidence,
    u: Array,
    left: Sequence[Array],
    slopes: Sequence[Array],
    columns: Sequence[Array],
) -> Scorer:
    """Scores beside a machine's own effects; columns: derivatives by their numbers, (n, k) each."""
    rows = seen.rows(u, left, slopes)
    return Scorer(rows.beside(seen.white(columns)) if columns[0].shape[1] else rows)


@dataclass(frozen=True, eq=False)
class Score:
    """A signature and what it gains.

    gain: over the inflation of the scale on which it weighs most
    fall: of chi^2 as the first scale foretells it
    """

    signature: Signature
    gain: Gain
    fall: float

    @property
    def label(self) -> str:
        """Of the hypothesis."""
        return self.signature.hypothesis.label


class Stage:
    """Where hypotheses are tried; the last scale shows orders and spots."""

    def __init__(
        self,
        confrontation: TorqueBalance,
        u: Array,
        left: Sequence[Array],
        scales: Sequence[Scale],
        work: Work,
    ) -> None:
        """Set the stage.

        Args:
            confrontation: the records beside the machine with its effects.
            u: its nuisances, shape (m,).
            left: what it leaves there, per series (n,).
            scales: at least one.
            work: clock, threads and listener.

        """
        heard = list(map(heard_above, confrontation.series, left))
        self.prober = Prober(confrontation, u, left, heard)
        self.scales, self.work = list(scales), work

    def listed(self, hypotheses: Sequence[Hypothesis], low: bool = False) -> list[Hypothesis]:
        """The same with their orders and spots as this machine shows them; see `with_orders`."""
        shown = self.scales[-1]
        rest = shown.rest
        ordered = with_orders(shown.evidence, rest, hypotheses, low)
        return distinct(with_spots(shown.evidence, rest, ordered))

    def scores(self, hypotheses: Sequence[Hypothesis]) -> list[Score]:
        """Gains on the scale on which each weighs most; none once time is up."""
        return [s for s in self.work.side_by_side(self._score, hypotheses) if s is not None]

    def _score(self, h: Hypothesis) -> Score | None:
        signature = None if self.work.stop() else self.prober(h)
        if signature is None:
            return None
        gains = [x.gain(signature) for x in self.scales]
        scaled = [replace(g, gain=g.gain / x.over) for g, x in zip(gains, self.scales, strict=True)]
        return Score(signature, max(scaled, key=lambda g: g.gain), gains[0].gain)


def with_orders(
    evidence: Evidence, rest: Array, hypotheses: Sequence[Hypothesis], low: bool = False
) -> list[Hypothesis]:
    """The same, those with an order at the strongest that the rest shows, and at the usual one.

    low: whether the lowest orders of a turn are tried anyway, where something faint is sought
    """
    known: dict[tuple[str, str], list[tuple[int, float]]] = {}
    core, found = evidence.confrontation.core, []
    mine = {p.path for p in core.parameters()}
    for h in hypotheses:
        grown, _ = h.put_in(core)
        paths = [
            p.path
            for p in grown.parameters()
            if p.path.endswith((".order", ".teeth")) and p.path not in mine
        ]
        if not paths:
            found.append(h)
            continue
        effect, group = h.effects[0]
        by = carrier(effect)
        parts = members_of(core, group)
        if not by:  # all turn alike
            parts = parts[:1]
        for place in parts:
            if (place, by) not in known:
                known[place, by] = strongest_orders(evidence, rest, place, by)
        usual = float(grown.get(paths[0]))
        every = HIGHEST * len(parts)
        seen = {float(n): every for place in parts for n, _ in known[place, by]}
        lowest = LOW if low and paths[0].endswith(".order") else ()
        orders = seen | {n: len(LOW) for n in lowest} | {usual: 1}
        orders = {n: k for n, k in orders.items() if is_seen(evidence, effect, group, n)}
        found += [
            replace(h, fixed={**h.fixed, paths[0]: n}, searched={h.label: k})
            for n, k in orders.items()
        ]
    return found


def is_seen(evidence: Evidence, effect: str, place: str, order: float) -> bool:
    """Whether the records tell an order of a place's angle from none at all.

    Less than a whole period of a ripple that is carried by the torque is a factor of all torques:
    as much off every inertia and friction does the same.
    """
    c = evidence.confrontation
    if carrier(effect) != "torque":
        return True
    reach = [own for part in members_of(c.core, place) if (own := travel_of(c, part)) is not None]
    return any(order * (last - first) >= 2.0 * math.pi for first, last in reach)


def with_spots(
    evidence: Evidence, rest: Array, hypotheses: Sequence[Hypothesis]
) -> list[Hypothesis]:
    """The same, those with a centre beginning where the rest shows a bump."""
    core, found = evidence.confrontation.core, list[Hypothesis]()
    known: dict[str, tuple[float, float] | None] = {}
    for h in hypotheses:
        effect, group = h.effects[0]
        if not any(p.path == "centre" for p in _core.effect_type(effect).parameters):
            found.append(h)
            continue
        place = members_of(core, group)[0]
        if place not in known:
            known[place] = worst_spot(evidence, rest, place)
        spot = known[place]
        there = dict(zip((f"{h.label}.centre", f"{h.label}.width"), spot or (), strict=False))
        searched = {**h.searched, **({h.label: TRIED} if there else {})}
        found.append(replace(h, begins={**h.begins, **there}, searched=searched))
    return found
