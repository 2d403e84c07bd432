"""From a survey to a verdict: whether anything is missing, and whether one name fits alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.heldout import held_out
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.result import Verdict
from dualdrive.diagnose.signatures import CONTAINS
from dualdrive.diagnose.survey import Survey, excess, key_of
from dualdrive.replay import ratio_to_table

Array = NDArray[np.float64]

#: fall of the criterion below which nothing is named: odds of 1 to e^10 before the library's size
NAMED = 20.0
#: more of it in the closed loop: an encoder's steps are a law of its angle, too, and no noise
STEPS = 5.0
#: the same for a second effect beside a first
SECOND = 25.0
#: of the criterion, tempered: odds of 1 to 20 against a law of the angle on less than a radian
SMALL_ARC = 12.0
#: of twice the log evidence: how sure differences between good fits are (see the blind suite)
TEMPER = 2.0
#: probability of the leader that makes it the only name
SURE = 0.9
#: share of what a free input could explain, below which a name explains too little
EXPLAINED = 0.75
#: in a torque balance, whose floors are reckoned: share below which nothing is named
FAINT = 0.5
#: share that a plainer law may explain less than one of the angle on a small arc, and be as likely
AS_MUCH = 0.03
#: share of its gain that a name must keep where each stretch is foretold from the others
KEPT = 0.25
#: residual over floor, RMS, from which something is surely left
LEFT_OVER = 1.22
FAR_OVER = 1.35  # in one series alone
#: how often a leader is right, however far the others that were tried are behind: by what it leaves
#: over the floor in its worst series, and by the share of what could be explained that it explains;
#: the larger counts. Chosen by hand on development cases; `tests.blind score` prints how it fares
RIGHT_AT_FLOOR = ((1.0, 1.15, 1.22), (0.95, 0.9, 0.0))
RIGHT_BY_SHARE = ((0.25, 0.5, 0.75, 0.9, 0.97), (0.05, 0.1, 0.45, 0.6, 0.85))
BALANCE = 3.0  # wider in a torque balance, whose floors are reckoned, not seen at standstill


@dataclass(frozen=True, eq=False)
class Judgement:
    """A verdict and the figures it rests on.

    ranked:    (refit, probability), nothing missing left out, best first
    nothing:   probability that nothing of the library is missing, among what was tried
    group:     labels that can't be told from the leader, the leader first
    explained: share of what could be explained that the leader explains
    excess:    largest residual over floor of any series, refitted and with the leader
    """

    verdict: Verdict
    ranked: Sequence[tuple[Refit, float]]
    nothing: float
    group: tuple[str, ...]
    explained: float
    excess: tuple[float, float]
    gain: float


def judge(found: Survey) -> Judgement:
    """Judge a survey; probabilities count that the true cause may be none of those tried."""
    judged = _among_the_tried(found)
    doubt = BALANCE if found.evidence.confrontation.mode == "balance" else 1.0
    at_floor = np.interp(1.0 + (judged.excess[1] - 1.0) / doubt, *RIGHT_AT_FLOOR)
    right = float(max(at_floor, np.interp(judged.explained, *RIGHT_BY_SHARE)))
    return replace(judged, ranked=[(r, right * p) for r, p in judged.ranked])


def _among_the_tried(found: Survey) -> Judgement:
    ranked, nothing = _probabilities(found)
    base = found.base
    best = ranked[0][0] if ranked else base
    before = excess(found, found.plain.left)
    gain = found.criterion[key_of(base)] - found.criterion[key_of(best)]
    balance = found.evidence.confrontation.mode == "balance"
    needed = NAMED + 2.0 * math.log(max(len(found.scores), 1)) + (0.0 if balance else STEPS)
    after = excess(found, best.left)
    doubt = BALANCE if balance else 1.0
    explained = _explained(before, after)
    figures = (explained, (float(before.max()), float(after.max())), gain)
    faint = balance and explained < FAINT
    if best is base or gain < needed or faint or not _foretells(found, best, gain):
        verdict: Verdict = "unknown" if _too_much(before, doubt) else _sound(found)
        return Judgement(verdict, ranked, nothing, (), *figures)
    if (explained < EXPLAINED and _too_much(after, doubt)) or best.beyond():
        return Judgement("unknown", ranked, nothing, (), *figures)
    leader = ranked[0][0]
    others = (*_twins(found, leader), *_plainer(found, leader, ranked))
    group = tuple(dict.fromkeys((*_group(ranked), *others)))
    verdict = "effect" if ranked[0][1] >= SURE and len(group) == 1 else "ambiguous"
    return Judgement(verdict, ranked, nothing, group if len(group) > 1 else (), *figures)


def _twins(found: Survey, best: Refit) -> list[str]:
    """Other laws that do the very same as the leader on these records."""
    return [
        label
        for effect, place in best.hypothesis.effects
        for label in found.twins.get(f"{effect}@{place}", ())
        if label.partition("@")[0] != effect
    ]


def _plainer(found: Survey, best: Refit, ranked: Sequence[tuple[Refit, float]]) -> list[str]:
    """Names that explain as much where the leader has a law of the angle on less than a radian.

    There it is a constant and a slope: a plain law and anything that varies along the way.
    """
    if not _small_arcs(found, best):
        return []
    least, own = explained_by(found, best) - AS_MUCH, set(best.hypothesis.effects)
    plainer = []
    for r, _ in ranked:
        [changed, *more] = own - set(r.hypothesis.effects) or [("", "")]
        alike = {e for e, _ in set(r.hypothesis.effects) - own}
        if changed[0] and not more and alike and not _small_arcs(found, r):
            confused = set(_core.effect_type(changed[0]).confused_with.split(","))
            if alike <= confused and explained_by(found, r) > least:
                plainer.append(r.hypothesis.label)
    return plainer


def _probabilities(found: Survey) -> tuple[list[tuple[Refit, float]], float]:
    """Of every refitted hypothesis, the best of those that differ in counted numbers alone."""
    by_label: dict[str, Refit] = {}
    singles = {
        r.hypothesis.effects[0]: _value(found, r)
        for r in reversed(found.refits)
        if len(r.hypothesis.effects) == 1
    }
    sound = [r for r in found.refits if not r.beyond()]
    for r in sound or found.refits:
        [*_, (effect, place)] = r.hypothesis.effects
        simpler = [singles.get((e, place), math.inf) for e in CONTAINS.get(effect, ())]
        if len(r.hypothesis.effects) == 1 and min(simpler, default=math.inf) <= _value(found, r):
            continue  # a whole law that does no more than the one it contains
        if len(r.hypothesis.effects) > 1:
            alone = min(singles.get(e, math.inf) for e in r.hypothesis.effects)
            if _value(found, r) > alone - SECOND or _foretells_worse(found, r):
                continue  # its second effect earns nothing
        label = r.hypothesis.label
        if label not in by_label or _value(found, r) < _value(found, by_label[label]):
            by_label[label] = r
    every = [found.base, *by_label.values()]
    least = min(_value(found, r) for r in every)
    weights = {id(r): math.exp(-0.5 * (_value(found, r) - least) / TEMPER) for r in every}
    whole = sum(weights.values())
    ranked = sorted(by_label.values(), key=lambda r: _value(found, r))
    return [(r, weights[id(r)] / whole) for r in ranked], weights[id(found.base)] / whole


def _foretells(found: Survey, best: Refit, gain: float) -> bool:
    """Whether what the leader gains it gains on stretches it was not fitted to, too."""
    seen = found.evidence
    with_it, without = (seen.white(held_out(seen, r)) for r in (best, found.base))
    return float(without @ without - with_it @ with_it) / found.inflation > KEPT * gain


def _foretells_worse(found: Survey, pair: Refit) -> bool:
    """Whether either effect alone foretells each stretch from the others better than both."""
    c, seen = found.evidence.confrontation, found.evidence
    alone = [r for r in found.refits if r.hypothesis.effects[0] in pair.hypothesis.effects]
    alone = [r for r in alone if len(r.hypothesis.effects) == 1]
    own = c.headline(held_out(seen, pair))
    return any(c.headline(held_out(seen, r)) < own for r in alone)


def _value(found: Survey, r: Refit) -> float:
    """The criterion, and the price of a law of the angle where hardly any angle was travelled.

    Over a small arc such a law is a constant or a slope, and the plainer name is the likelier one.
    """
    return found.criterion[key_of(r)] + SMALL_ARC * _small_arcs(found, r)


def _small_arcs(found: Survey, r: Refit) -> int:
    """How many of its laws of the angle saw less than a radian of it."""
    travel = found.evidence.confrontation.sizes().get("travel", 0.0)
    count = 0
    for effect, place in r.hypothesis.effects:
        label = f"{effect}@{place}"
        order = max([x for p, x in r.hypothesis.fixed.items() if p.startswith(label)], default=1.0)
        if any(p.path == f"{label}.phase" for p in r.free):
            arc = order * travel * ratio_to_table(found.evidence.confrontation.core, _part(place))
            count += arc < 1.0
    return count


def _part(place: str) -> str:
    """One part of a group."""
    return {"motors": "motor_1", "pinions": "pinion_1", "meshes": "mesh_1"}.get(place, place)


def _explained(before: Array, after: Array) -> float:
    """Share of the mean squares above the floor that went, each series counting alike."""
    could = np.maximum(1.0 - 1.0 / before**2, 0.0)
    went = 1.0 - after**2 / before**2
    whole = float(could.sum())
    return float(min(max(went.sum() / whole, 0.0), 1.0)) if whole > 1e-3 else 1.0


def explained_by(found: Survey, r: Refit) -> float:
    """Share of what could be explained that a refit explains, 0 .. 1."""
    return _explained(excess(found, found.plain.left), excess(found, r.left))


def _too_much(ratios: Array, doubt: float) -> bool:
    """Whether more is left than the sensors leave, in more than one series or by far in one."""
    ordered = np.sort(ratios)[::-1]
    second = ordered[1] if len(ordered) > 1 else 0.0
    return bool(ordered[0] > doubt * FAR_OVER or second > doubt * LEFT_OVER)


def _sound(found: Survey) -> Verdict:
    """Adequate as it came, or only after its numbers moved."""
    seen = found.evidence
    nominal = seen.chi(found.nominal.u, found.nominal.left)
    fall = (nominal - found.base.chi) / found.inflation
    return "parameters" if fall > NAMED + len(found.base.u) else "adequate"


def _group(ranked: Sequence[tuple[Refit, float]]) -> tuple[str, ...]:
    """The leader and those that keep the sum of probabilities from being sure."""
    group, whole = [], 0.0
    for r, p in ranked:
        if whole >= SURE:
            break
        group.append(r.hypothesis.label)
        whole += p
    return tuple(group)
