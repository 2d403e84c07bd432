"""Laws nearly like the best one, at its own part, refitted before that one gets the name.

Scores are taken about the machine that lacks every law. Near relatives (play of a reducer and its
compliance, dry friction and friction that varies along the turn, one order and the next) gain
nearly alike there, and a poor score or a start in a side valley must not decide between them. What
the library says the best law is confused with is therefore tried on the best one's numbers, in its
stead; and where it leaves something, the same law at other orders.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

from dualdrive.diagnose.candidates import akin, candidates, members, station
from dualdrive.diagnose.floors import heard_above
from dualdrive.diagnose.hypotheses import Hypothesis, Setting
from dualdrive.diagnose.profiled import profile, sharpened
from dualdrive.diagnose.refit import Fitter, Refit, Start, Trial
from dualdrive.diagnose.score import Scorer
from dualdrive.diagnose.secants import with_values
from dualdrive.diagnose.settle import ENOUGH, settle
from dualdrive.diagnose.shortlist import distinct
from dualdrive.diagnose.signatures import (
    CONTAINS,
    Prober,
    Score,
    score_all,
    with_orders,
    with_spots,
)
from dualdrive.diagnose.starts import beside, grown_from
from dualdrive.diagnose.survey import Survey, excess
from dualdrive.diagnose.work import Work

_REFITTED = 3  # of those that were tried, the lowest
_ROUNDS = 2  # a neighbour that is better has neighbours of its own


def with_neighbours(found: Survey, work: Work) -> Survey:
    """Refit what the best hypothesis may be taken for, until none of it is better."""
    for _ in range(_ROUNDS):
        best = found.best
        if best is found.base or not work.clock.allows(f"what else {best.hypothesis.label} may be"):
            return found
        work.tell(f"what else {best.hypothesis.label} may be")
        trials = [
            trial
            for number in range(len(best.hypothesis.effects))
            for trial in _tried(found, _Stead.of(best, number), work)
        ]
        trials.sort(key=lambda t: profile(found.evidence, t))
        fitter = Fitter(found.evidence, work.stop)

        def refitted(trial: Trial, fitter: Fitter = fitter, best: Refit = best) -> Refit:
            return sharpened(fitter, fitter(trial, best.slopes))

        more = work.side_by_side(refitted, trials[:_REFITTED])
        if not more:
            return found
        found = settle(replace(found, refits=[*found.refits, *more]), work)
        if found.best.hypothesis == best.hypothesis:
            return found
    return found


@dataclass(frozen=True, eq=False)
class _Stead:
    """The best hypothesis with one effect taken out, all numbers as they were beside it.

    effect, place: what was taken out; own: its numbers by their names
    rest: what stays, with its numbers by path
    """

    best: Refit
    effect: str
    place: str
    own: Setting
    rest: Hypothesis
    values: Setting

    @staticmethod
    def of(best: Refit, number: int) -> _Stead:
        effects, h = best.hypothesis.effects, best.hypothesis
        label = "@".join(effects[number])
        values = {**best.values(), **h.fixed}
        own = {p.rpartition(".")[2]: x for p, x in values.items() if p.startswith(f"{label}.")}
        stays = {p: x for p, x in best.values().items() if not p.startswith(f"{label}.")}
        fixed = {p: x for p, x in h.fixed.items() if not p.startswith(f"{label}.")}
        rest = Hypothesis(effects[:number] + effects[number + 1 :], fixed)
        return _Stead(best, *effects[number], own, rest, stays)


def _tried(found: Survey, stead: _Stead, work: Work) -> Iterator[Trial]:
    """Neighbours of what was taken out, each at the best of its starts."""
    c, best, seen = copy(found.evidence.confrontation), stead.best, found.evidence
    label = f"{stead.effect}@{stead.place}"
    kept = [(j, p) for j, p in enumerate(best.free) if not p.path.startswith(f"{label}.")]
    grown, _ = stead.rest.put_in(c.core, c.sizes(), c.part_sizes(stead.rest.effects))
    c.core = with_values(grown, [p for _, p in kept], best.v[[j for j, _ in kept]])
    left = c.left(c.core, best.u)
    if left is None:
        return
    rows = seen.rows(best.u, left, best.slopes)
    own = seen.white([x[:, [j for j, _ in kept]] for x in best.columns])
    scorer = Scorer(rows.beside(own))
    prober = Prober(c, best.u, left, list(map(heard_above, c.series, left)))
    several = _neighbours(found, stead, c.core, scorer)
    for score in score_all(prober, [(seen, scorer)], [1.0], several, work):
        starts = _starts(score, stead)
        both = stead.rest + score.signature.hypothesis
        trial = Fitter(seen, work.stop).tried(both, starts, slopes=best.slopes)
        if trial is not None:
            yield trial


def _neighbours(found: Survey, stead: _Stead, core: Any, scorer: Scorer) -> list[Hypothesis]:
    """Of the same station, and not refitted in this company yet.

    core: the machine with all that stays
    """
    seen = found.evidence
    c = seen.confrontation
    every = candidates(core, c.channels, balance=c.mode == "balance")
    every += [m for h in every for m in members(core, h)]
    alike = [
        h
        for h in every
        if akin(h.effects[0][0], stead.effect) and station(h.effects[0][1]) == station(stead.place)
    ]
    own = [h for h in alike if h.effects[0][0] == stead.effect]
    leaves = excess(found, stead.best.left).max() >= ENOUGH
    rest = scorer.rest(scorer.rows.left[:, None])[:, 0]
    listed = with_orders(seen, rest, [h for h in alike if h not in own])
    listed += with_orders(seen, rest, own, low=True) if leaves else []
    known = {_content(r.hypothesis) for r in found.refits}
    fresh = [h for h in distinct(listed) if _content(stead.rest + h) not in known]
    return with_spots(seen, rest, fresh)


def _content(h: Hypothesis) -> frozenset[object]:
    """What a hypothesis holds, in whatever order."""
    return frozenset([*h.effects, *h.fixed.items()])


def _starts(score: Score, stead: _Stead) -> Iterator[Start]:
    """With the numbers of like name that the best one has, and where the score points."""
    u, (effect, _) = stead.best.u, score.signature.hypothesis.effects[0]
    if stead.effect in CONTAINS.get(effect, ()) and "torque" in stead.own and not stead.values:
        yield from grown_from(score, stead.best)
        return
    shared = {f"{score.label}.{name}": x for name, x in stead.own.items()}
    for setting in score.signature.settings:
        both = {p: shared.get(p, x) for p, x in setting.items()}
        if both != setting:
            yield Start(u, {**stead.values, **both})
    yield from beside(score, u, stead.values)
