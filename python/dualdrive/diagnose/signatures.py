"""Signatures of hypotheses, their scores, and refits of the best."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.hypotheses import Hypothesis, Setting, is_strength, probes
from dualdrive.diagnose.orders import members_of, strongest_orders
from dualdrive.diagnose.refit import Fitter, Refit
from dualdrive.diagnose.score import Gain, Scorer

Array = NDArray[np.float64]

#: RMS change, in units of noise, that a probe may make in its most touched series, and must
_LOUD, _FAINT = 10.0, 0.005
_WISHED = 0.5
_FAINTER = (0.1, 0.01)
_SHORTEST_DELAY = 2e-4  # s: of a probe
_ALONG = (0.15, 0.5, 0.85)  # of the travel: where a local fault is tried
#: laws of friction and the simpler ones they contain, best first
CONTAINS = {"stribeck": ("coulomb",), "lugre": ("stribeck", "coulomb")}


@dataclass(frozen=True, eq=False)
class Signature:
    """How a hypothesis would show: change of every series per probe, (n, k) each."""

    hypothesis: Hypothesis
    grown: Any
    settings: Sequence[Setting]
    columns: Sequence[Array]


@dataclass(frozen=True, eq=False)
class Score:
    """A signature and what it gains."""

    signature: Signature
    gain: Gain

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
        settings, factor = tried, self._factor(first)
        if late:  # a short delay is a slow simulation
            factor = min(max(factor, _SHORTEST_DELAY / _longest(settings[0])), 1.0)
        if factor != 1.0 and strengths:
            settings = _scaled(settings, factor, strengths)
            first = self._change(grown, settings[0])
        changes = [first, *(self._change(grown, one) for one in settings[1:])]
        kept = [(s, c) for s, c in zip(settings, changes, strict=True) if c is not None]
        if not kept or first is None:
            return None
        columns = [np.stack(parts, axis=1) for parts in zip(*(c for _, c in kept), strict=True)]
        return Signature(hypothesis, grown, [s for s, _ in kept], columns)

    def _travel(self, hypothesis: Hypothesis) -> list[float]:
        """Angles along the travel of the effect's place, rad."""
        angles = [
            a
            for k in range(len(self.confrontation.series))
            if (a := self.confrontation.angle(k, hypothesis.effects[-1][1])) is not None
        ]
        if not angles:
            return []
        low, high = min(a.min() for a in angles), max(a.max() for a in angles)
        return [float(low + share * (high - low)) for share in _ALONG]

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
    evidence: Evidence, rest: Array, hypotheses: Sequence[Hypothesis]
) -> list[Hypothesis]:
    """The same, those with an order at the strongest that the rest shows, and at the usual one."""
    known: dict[str, list[tuple[int, float]]] = {}
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
        place = members_of(core, h.effects[0][1])[0]
        if place not in known:
            known[place] = strongest_orders(evidence, rest, place)
        usual = float(grown.get(paths[0]))
        orders = [*(float(n) for n, _ in known[place]), usual]
        found += [Hypothesis(h.effects, {**h.fixed, paths[0]: n}) for n in dict.fromkeys(orders)]
    return found


def starts_of(score: Score) -> list[Setting]:
    """Where a refit may begin: what the score expects, and the probes themselves."""
    settings, strengths = score.signature.settings, score.gain.strengths
    grown = score.signature.grown
    base = dict(settings[0])
    expected, amplitude = dict(base), float(strengths[0])
    whole = amplitude
    for one, g in zip(settings[1:], strengths[1:], strict=True):
        moved = next(path for path in one if one[path] != base[path] and one[path] != 0.0)
        if is_strength(grown, moved):
            expected[moved] = float(g) * one[moved]
        elif moved.endswith("phase"):
            expected[moved] = base[moved] + math.atan2(float(g), amplitude)
            whole = math.hypot(amplitude, float(g))
        elif not moved.endswith("centre") and (sum_ := whole + float(g)) > 0:
            share = min(max(float(g) / sum_, -1.0), 2.0)
            expected[moved] = base[moved] + share * (one[moved] - base[moved])
            whole = sum_
    first = next((path for path in base if is_strength(grown, path)), "")
    size = max(whole, 0.1)
    if first:
        expected[first] = base[first] * whole
    found = [expected, {**base, first: base[first] * size} if first else base, base]
    for one in settings[1:]:
        found.append({**one, first: one[first] * size} if first else dict(one))
    found += [
        {**found[1], path: factor * x}
        for path, x in base.items()
        if path.endswith((".speed", ".stiffness"))
        for factor in (0.2, 3.0)
    ]
    return found


def fit_all(
    fitter: Fitter,
    base: Refit,
    scores: Sequence[Score],
    threads: int,
    tell: Callable[[str], None],
) -> list[Refit]:
    """Refit each, side by side; those that can't be simulated or were never begun are left out.

    Laws that contain a simpler one of the same place come after it and begin from it.
    """
    whole = [s for s in scores if s.signature.hypothesis.effects[-1][0] in CONTAINS]
    simple = [s for s in scores if s not in whole]
    known: dict[tuple[str, str], Refit] = {}

    def one(score: Score) -> Refit | None:
        if fitter.stop():
            return None
        h = score.signature.hypothesis
        tell(f"refitting with {h.label}")
        effect, place = h.effects[-1]
        first = next(
            (known[e, place] for e in CONTAINS.get(effect, ()) if (e, place) in known), None
        )
        if first is None:
            return fitter(h, base, starts_of(score))
        return fitter(h, first, _grown_from(score, first))

    found: list[Refit] = []
    for several in (simple, whole):
        if threads == 1 or len(several) < 2:
            fitted = [one(s) for s in several]
        else:
            with ThreadPoolExecutor(threads) as pool:
                fitted = list(pool.map(one, several))
        found += [r for r in fitted if r is not None]
        known.update({r.hypothesis.effects[-1]: r for r in found})
    return found


def _grown_from(score: Score, simple: Refit) -> list[dict[str, float]]:
    """Starts of a whole law that do what the simpler one did: the same level, little more."""
    label = score.signature.hypothesis.label
    level = next(x for path, x in simple.values().items() if path.endswith(".torque"))
    settings = score.signature.settings[0]
    base = {**settings, f"{label}.torque": level, f"{label}.static_ratio": 1.15}
    speeds = [settings[f"{label}.speed"] * factor for factor in (0.1, 0.3, 1.0, 3.0)]
    return [{**base, f"{label}.speed": v} for v in speeds]


def score_all(
    prober: Prober,
    judges: Sequence[tuple[Evidence, Scorer]],
    over: Sequence[float],
    hypotheses: Sequence[Hypothesis],
    threads: int,
    stop: Callable[[], bool],
) -> list[Score]:
    """Signatures and gains over the inflation of each judge, the best judge counting."""

    def one(h: Hypothesis) -> Score | None:
        if stop():
            return None
        signature = prober(h)
        if signature is None:
            return None
        gains = [judge(e.white(signature.columns)) for e, judge in judges]
        scaled = [
            replace(g, gain=g.gain / o, held_out=g.held_out / o)
            for g, o in zip(gains, over, strict=True)
        ]
        return Score(signature, max(scaled, key=lambda g: g.gain))

    if threads == 1:
        found = list(map(one, hypotheses))
    else:
        with ThreadPoolExecutor(threads) as pool:
            found = list(pool.map(one, hypotheses))
    return [s for s in found if s is not None]
