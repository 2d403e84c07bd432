"""Laws nearly like the best one, on its own drive train, refitted before that one gets the name.

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

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.candidates import akin, group_of, members, station, tried_with
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.hypotheses import Hypothesis, Setting, distinct
from dualdrive.diagnose.laws import CONTAINS
from dualdrive.diagnose.orders import HIGHEST
from dualdrive.diagnose.pairs import together
from dualdrive.diagnose.profiled import profile, sharpened
from dualdrive.diagnose.refit import Fitter, Refit, Start, Trial
from dualdrive.diagnose.secants import with_values
from dualdrive.diagnose.settle import ENOUGH, settle
from dualdrive.diagnose.stage import (
    Scale,
    Score,
    Stage,
    is_seen,
    scorer_of,
    with_orders,
    with_spots,
)
from dualdrive.diagnose.starts import beside, grown_from
from dualdrive.diagnose.survey import Survey, excess, key_of
from dualdrive.diagnose.work import Work, first_of_each
from dualdrive.replay import ratio_to_table

Array = NDArray[np.float64]

#: in the stead of each effect: the lowest of those that were tried, and of other laws than these
_REFITTED, _OTHERS = 3, 2
_COUNTED = ("order", "teeth")  # per turn
_MUCH = 0.5  # of the best one's gain
_ROUNDS = 2  # a neighbour that is better has neighbours of its own


def with_neighbours(found: Survey, work: Work) -> Survey:
    """Refit what the best hypothesis may be taken for; once more where that is better."""
    for _ in range(_ROUNDS):
        best = found.best
        label = best.hypothesis.label
        if best is found.base or not work.clock.allows(f"what else {label} may be"):
            return found
        work.tell(f"what else {label} may be")
        trials = _in_one(found, best, work)
        trials += [
            trial
            for number in range(len(best.hypothesis.effects))
            for trial in _lowest(found, _tried(found, _Stead(best, number), work))
        ]
        more = _refitted(Fitter(found.evidence, work.stop), best, trials, work)
        if len(more) < len(trials):
            work.clock.leave_out(f"not all was refitted that {label} may be")
        if not more:
            return found
        found = settle(replace(found, refits=[*found.refits, *more]), work)
        if found.best.hypothesis == best.hypothesis:
            return found
    return found


def _in_one(found: Survey, best: Refit, work: Work) -> list[Trial]:
    """One law at all the parts of a group, where the best hypothesis has it at each of them.

    Alone it may have ended in a side valley: it begins from the mean of their numbers.
    """
    h, c = best.hypothesis, found.evidence.confrontation
    several = [place for _, place in h.effects]
    group = group_of(c.core, several)
    if len(several) < 2 or not group or len({effect for effect, _ in h.effects}) > 1:
        return []
    [(effect, _), *_] = h.effects
    label = f"{effect}@{group}"

    def mean(numbers: Setting) -> Setting:
        names = dict.fromkeys(path.rpartition(".")[2] for path in numbers)
        own = {n: [x for p, x in numbers.items() if p.endswith(f".{n}")] for n in names}
        return {f"{label}.{n}": float(np.mean(x)) for n, x in own.items()}

    looked = {label: max(h.searched.values())} if h.searched else {}
    whole = Hypothesis(((effect, group),), mean(dict(h.fixed)), looked)
    start = Start(best.u, mean(best.values()))
    trial = together(Fitter(found.evidence, work.stop), whole, [start], best.slopes)
    return [] if trial is None else [trial]


@dataclass(frozen=True, eq=False)
class _Stead:
    """Where one effect of the best hypothesis is taken out and others are put in.

    number: of the effect in its list
    """

    best: Refit
    number: int

    @property
    def effect(self) -> str:
        return self.best.hypothesis.effects[self.number][0]

    @property
    def place(self) -> str:
        return self.best.hypothesis.effects[self.number][1]

    @property
    def label(self) -> str:
        return f"{self.effect}@{self.place}"

    @property
    def own(self) -> Setting:
        """Numbers of what is taken out, by their names."""
        values = {**self.best.values(), **self.best.hypothesis.fixed}
        return {p.rpartition(".")[2]: x for p, x in values.items() if self._is_own(p)}

    @property
    def stays(self) -> Setting:
        """Numbers of what stays, by path."""
        return {p: x for p, x in self.best.values().items() if not self._is_own(p)}

    @property
    def rest(self) -> Hypothesis:
        """What stays."""
        h = self.best.hypothesis
        return h.only([k for k in range(len(h.effects)) if k != self.number])

    def confronted(self, c: TorqueBalance) -> tuple[TorqueBalance, list[int]]:
        """The records beside the machine with what stays, and which of the best's numbers are."""
        kept = [j for j, p in enumerate(self.best.free) if not self._is_own(p.path)]
        grown, _ = self.rest.put_in(c.core, c.sizes())
        without = copy(c)
        without.core = with_values(grown, [self.best.free[j] for j in kept], self.best.v[kept])
        return without, kept

    def _is_own(self, path: str) -> bool:
        return path.rpartition(".")[0] == self.label


def _tried(found: Survey, stead: _Stead, work: Work) -> list[Trial]:
    """Neighbours of what was taken out, each at the best of its starts."""
    best, seen = stead.best, found.evidence
    c, kept = stead.confronted(seen.confrontation)
    left = c.left(c.core, best.u)
    if left is None:
        return []
    columns = [x[:, kept] for x in best.columns]
    own = Scale(seen, scorer_of(seen, best.u, left, best.slopes, columns))
    stage = Stage(c, best.u, left, [own], work)
    scores = stage.scores(_neighbours(found, stead, c.core, own.rest))
    fitter = Fitter(seen, work.stop)

    def tried(score: Score) -> Trial | None:
        h = best.hypothesis.instead(stead.number, score.signature.hypothesis)
        return together(fitter, h, _starts(score, stead), best.slopes)

    return [trial for trial in work.side_by_side(tried, scores) if trial is not None]


def _neighbours(found: Survey, stead: _Stead, core: Any, rest: Array) -> list[Hypothesis]:
    """Of the same station, and not refitted in this company yet.

    core: the machine with all that stays; rest: white rows of what it leaves, (n,)
    """
    seen = found.evidence
    c = seen.confrontation
    every = tried_with(c, core)
    every += [m for h in every for m in members(core, h)]
    twins = {label for several in found.twins.values() for label in several}
    alike = [h for h in every if _is_near(h, stead) and h.label not in twins]
    here = station(stead.place)
    own = [h for h in alike if h.effects[0][0] == stead.effect and station(h.effects[0][1]) == here]
    leaves = excess(found, stead.best.left).max() >= ENOUGH
    others = [h for h in alike if h not in own]
    listed = with_orders(seen, rest, others)
    as_often = (_as_often(h, stead, core) for h in others)
    listed += [
        h for h in as_often if h is not None and is_seen(seen, *h.effects[0], max(h.fixed.values()))
    ]
    if leaves:  # no order is cheaper than the one that was found
        listed += [
            replace(h, searched=dict.fromkeys(h.searched, HIGHEST))
            for h in with_orders(seen, rest, own, low=True)
        ]
    known = {_content(r.hypothesis) for r in found.refits if _is_found(found, r)}
    whole = stead.best.hypothesis
    fresh = [h for h in distinct(listed) if _content(whole.instead(stead.number, h)) not in known]
    return with_spots(seen, rest, fresh)


def _is_found(found: Survey, r: Refit) -> bool:
    """Whether a refit gains about what its relative does: else it ended in a side valley."""
    none, best, own = (found.criterion[key_of(x)] for x in (found.base, found.best, r))
    return none - own > _MUCH * (none - best)


def _is_near(h: Hypothesis, stead: _Stead) -> bool:
    """Whether the library confuses them, at one station; late signals only with late ones.

    What a mesh does once per tooth it does at both of its wheels.
    """
    [(effect, place)] = h.effects
    if not akin(effect, stead.effect) or (_is_late(effect) and not _is_late(stead.effect)):
        return False
    stations = {station(place), station(stead.place)}
    wheels = stations <= {"table", "drives"} and _is_meshing(effect) and _is_meshing(stead.effect)
    return len(stations) == 1 or wheels


def _as_often(h: Hypothesis, stead: _Stead, core: Any) -> Hypothesis | None:
    """The same as often per turn of the table as what is taken out; None where none is counted."""
    grown, _ = h.put_in(core)
    mine = {p.path for p in grown.parameters()}
    paths = [path for name in _COUNTED if (path := f"{h.label}.{name}") in mine]
    known = [stead.own[name] for name in _COUNTED if name in stead.own]
    if not paths or not known:
        return None
    there, here = _part(stead.best.grown, stead.label), _part(grown, h.label)
    if not there or not here:
        return None
    n = max(round(known[0] * ratio_to_table(core, there) / ratio_to_table(core, here)), 1)
    searched = stead.best.hypothesis.searched.get(stead.label, 1)
    return replace(h, fixed={**h.fixed, paths[0]: float(n)}, searched={h.label: searched})


def _is_meshing(effect: str) -> bool:
    return "mesh" in _core.effect_type(effect).acts_on.split(", ")


def _is_late(effect: str) -> bool:
    return "delay" in _core.effect_type(effect).acts_on


def _content(h: Hypothesis) -> frozenset[object]:
    """What a hypothesis holds, in whatever order."""
    return frozenset([*h.effects, *h.fixed.items()])


def _lowest(found: Survey, trials: list[Trial]) -> list[Trial]:
    """The lowest, and the lowest of other laws than theirs."""
    ordered = sorted(trials, key=lambda t: profile(found.evidence, t))
    lowest = ordered[:_REFITTED]
    known = {t.hypothesis.label for t in lowest}
    others = [t for t in ordered if t.hypothesis.label not in known]
    return [*lowest, *first_of_each(others, lambda t: t.hypothesis.label)[:_OTHERS]]


def _refitted(fitter: Fitter, best: Refit, trials: list[Trial], work: Work) -> list[Refit]:
    """Refits of the trials; those that time was left for."""

    def one(trial: Trial) -> Refit | None:
        if work.stop():
            return None
        work.tell(f"refitting with {trial.hypothesis.label}")
        return sharpened(fitter, fitter(trial, best.slopes))

    return [r for r in work.side_by_side(one, trials) if r is not None]


def _starts(score: Score, stead: _Stead) -> Iterator[Start]:
    """With the numbers of like name that the best one has, and where the score points."""
    u, h, stays = stead.best.u, score.signature.hypothesis, stead.stays
    [(effect, place)] = h.effects
    whole = stead.effect in CONTAINS.get(effect, ()) and "torque" in stead.own
    if whole and not stays and place == stead.place:
        yield from grown_from(score, stead.best)
        return
    shared = _carried(score, stead)
    settings = [{p: shared.get(p, x) for p, x in one.items()} for one in score.signature.settings]
    for setting in {tuple(one.items()): one for one in settings}.values() if shared else ():
        yield Start(u, {**stays, **setting})
    yield from beside(score, u, stays)


def _carried(score: Score, stead: _Stead) -> Setting:
    """Numbers of like name by the other law's paths; at another part of the train, its torque."""
    grown, h = score.signature.grown, score.signature.hypothesis
    if h.effects[0][1] == stead.place:
        return {f"{h.label}.{name}": x for name, x in stead.own.items()}
    parts = (_part(stead.best.grown, stead.label), _part(grown, h.label))
    if "torque" not in stead.own or not all(parts):
        return {}
    there, here = (ratio_to_table(grown, part) for part in parts)
    return {f"{h.label}.torque": stead.own["torque"] * there / here}


def _part(core: Any, label: str) -> str:
    """One part that an effect sits at, if any."""
    [effect] = [e for e in core.effects if e["label"] == label]
    return next(iter(effect["members"]), "")
