"""Signatures of hypotheses, and their scores."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.hypotheses import Hypothesis, Setting, is_strength, probes
from dualdrive.diagnose.orders import (
    CARRIERS,
    HIGHEST,
    LOW,
    members_of,
    strongest_orders,
    travel_of,
)
from dualdrive.diagnose.score import Gain, Scorer
from dualdrive.diagnose.spots import TRIED, worst_spot
from dualdrive.diagnose.work import Work

Array = NDArray[np.float64]

#: RMS change, in units of noise, that a probe may make in its most touched series, and must
_LOUD, _FAINT = 10.0, 0.005
_WISHED = 0.5
_FAINTER = (0.1, 0.01)
_RESIZED = 3  # times at most: far too strong a probe does not tell by how much
_SHORTEST_DELAY = 2e-4  # s: of a probe
_ALONG = (0.15, 0.5, 0.85)  # of the travel: where a local fault is tried
#: laws of friction and the simpler ones they contain, best first
CONTAINS = {"stribeck": ("coulomb",), "lugre": ("stribeck", "coulomb")}


@dataclass(frozen=True, eq=False)
class Signature:
    """How a hypothesis would show: change of every series per probe, (n, k) each.

    settings: of the probes, made to be seen; usual: of the first, at its usual size
    strength: path of the effect's first strength, by which a probe grows; empty where it has
        none, or shows at once as a whole: limits, compliance, play
    """

    hypothesis: Hypothesis
    grown: Any
    settings: Sequence[Setting]
    usual: Setting
    strength: str
    columns: Sequence[Array]


@dataclass(frozen=True, eq=False)
class Score:
    """A signature and what it gains.

    gain: over the inflation of the judge that it convinces most
    fall: of chi^2 as the first judge foretells it
    """

    signature: Signature
    gain: Gain
    fall: float

    @property
    def label(self) -> str:
        """Of the hypothesis."""
        return self.signature.hypothesis.label


class Prober:
    """Finds signatures about one machine, its nuisances at u."""

    def __init__(
        self, confrontation: Confrontation, u: Array, left: Sequence[Array], noise: Sequence[float]
    ) -> None:
        self.confrontation, self.u, self.left, self.noise = confrontation, u, left, noise
        self.sizes = confrontation.sizes()

    def __call__(self, hypothesis: Hypothesis) -> Signature | None:
        """None where the core can't simulate it."""
        c = self.confrontation
        parts = c.part_sizes(hypothesis.effects)
        grown, paths = hypothesis.put_in(c.core, self.sizes, parts)
        free = hypothesis.unknowns(grown, paths, self.sizes)
        if not free:
            return None  # nothing of it can be fitted
        settings = probes(grown, free, self._travel(hypothesis))
        usual = settings[0]
        strengths = {p.path: (p.low, p.high) for p in free if is_strength(grown, p.path)}
        late = any("delay" in _core.effect_type(e).acts_on for e, _ in hypothesis.effects)
        first = None
        for fainter in (1.0, *_FAINTER):  # a loop may not stand it at its usual size
            tried = _scaled(settings, fainter, strengths)
            first = self._change(grown, tried[0])
            if first is not None or not strengths:
                break
        if first is None:
            return None
        settings = tried
        for _ in range(_RESIZED if strengths else 0):
            factor = self._factor(first)
            if late:  # a short delay is a slow simulation
                factor = min(max(factor, _SHORTEST_DELAY / _longest(settings[0])), 1.0)
            if factor == 1.0:
                break
            settings = _scaled(settings, factor, strengths)
            other = self._change(grown, settings[0])
            if other is None:
                return None
            first = other
        changes = [first, *(self._change(grown, one) for one in settings[1:])]
        kept = [(s, c) for s, c in zip(settings, changes, strict=True) if c is not None]
        if not kept or first is None:
            return None
        columns = [np.stack(parts, axis=1) for parts in zip(*(c for _, c in kept), strict=True)]
        strength = next((path for path in usual if path in strengths), "")
        return Signature(hypothesis, grown, [s for s, _ in kept], usual, strength, columns)

    def _travel(self, hypothesis: Hypothesis) -> list[float]:
        """Angles along the travel of the effect's place, rad; about its spot where one is known."""
        c, label = self.confrontation, hypothesis.label
        if f"{label}.centre" in hypothesis.begins:
            centre, width = (hypothesis.begins[f"{label}.{name}"] for name in ("centre", "width"))
            return [centre - 0.5 * width, centre + 0.5 * width]
        reach = travel_of(c, hypothesis.effects[-1][1])
        if reach is None:
            return []
        return [reach[0] + share * (reach[1] - reach[0]) for share in _ALONG]

    def _change(self, grown: Any, setting: Mapping[str, float]) -> list[Array] | None:
        core = grown.copy()
        for path, value in setting.items():
            core.set(path, value)
        there = self.confrontation.left(core, self.u)
        if there is None:
            return None
        return [b - a for a, b in zip(self.left, there, strict=True)]

    def _factor(self, change: Sequence[Array]) -> float:
        """By how much a probe should be stronger or fainter."""
        loud = max(
            float(np.sqrt(np.mean(c**2))) / max(n, 1e-300)
            for c, n in zip(change, self.noise, strict=True)
        )
        if not math.isfinite(loud) or loud <= 0.0 or _FAINT <= loud <= _LOUD:
            return 1.0
        return float(min(max(_WISHED / loud, 1e-4), 1e4))


def _scaled(
    settings: Sequence[Setting], factor: float, bounds: Mapping[str, tuple[float, float]]
) -> list[Setting]:
    """The same with every strength so much larger, inside its bounds."""
    return [
        {
            path: min(max(x * factor, bounds[path][0]), bounds[path][1])
            if path in bounds and x != 0.0
            else x
            for path, x in one.items()
        }
        for one in settings
    ]


def _longest(setting: Setting) -> float:
    return max(setting.values(), default=1.0) or 1.0


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
        carrier = CARRIERS.get(effect, "")
        parts = members_of(core, group)
        if not carrier:  # all turn alike
            parts = parts[:1]
        for place in parts:
            if (place, carrier) not in known:
                known[place, carrier] = strongest_orders(evidence, rest, place, carrier)
        usual = float(grown.get(paths[0]))
        every = HIGHEST * len(parts)
        seen = {float(n): every for place in parts for n, _ in known[place, carrier]}
        lowest = LOW if low and paths[0].endswith(".order") else ()
        orders = seen | {n: len(LOW) for n in lowest} | {usual: 1}
        found += [
            replace(h, fixed={**h.fixed, paths[0]: n}, searched={h.label: k})
            for n, k in orders.items()
        ]
    return found


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


def score_all(
    prober: Prober,
    judges: Sequence[tuple[Evidence, Scorer]],
    over: Sequence[float],
    hypotheses: Sequence[Hypothesis],
    work: Work,
) -> list[Score]:
    """Signatures and gains over the inflation of each judge, the best judge counting."""

    def one(h: Hypothesis) -> Score | None:
        if work.stop():
            return None
        signature = prober(h)
        if signature is None:
            return None
        gains = [
            (judge if signature.strength else judge.whole)(e.white(signature.columns))
            for e, judge in judges
        ]
        scaled = [
            replace(g, gain=g.gain / o, held_out=g.held_out / o)
            for g, o in zip(gains, over, strict=True)
        ]
        return Score(signature, max(scaled, key=lambda g: g.gain), gains[0].gain)

    return [s for s in work.side_by_side(one, hypotheses) if s is not None]
