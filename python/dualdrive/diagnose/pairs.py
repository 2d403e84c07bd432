"""Two effects at once: what a good one leaves is scored again, and the best few are refitted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from dualdrive.diagnose.refit import Fitter, Refit, Start
from dualdrive.diagnose.score import Scorer
from dualdrive.diagnose.settle import ENOUGH, settle
from dualdrive.diagnose.signatures import CONTAINS, Score
from dualdrive.diagnose.starts import near
from dualdrive.diagnose.survey import Clock, Survey, excess, key_of

_FIRSTS, _SECONDS = 2, 3  # effects to begin with, and partners of each
_WORTH = 15.0  # expected fall of chi^2 over its inflation for which a second effect is tried


def with_pairs(found: Survey, clock: Clock, tell: Callable[[str], None]) -> Survey:
    """Refit pairs where the best single effect leaves more than noise."""
    singles = [r for r in found.refits if len(r.hypothesis.effects) == 1]
    singles.sort(key=lambda r: found.criterion[key_of(r)])
    if not singles or found.best is found.base or excess(found, found.best.left).max() < ENOUGH:
        return found
    fitter, refits, known = Fitter(found.evidence, clock.stop), list[Refit](), set[frozenset[str]]()
    for first in _firsts(singles):
        for score in _partners(found, first):
            both = frozenset((first.hypothesis.label, score.label))
            if both in known:
                continue
            known.add(both)
            if clock.stop():
                clock.leave_out(f"not refitted: {first.hypothesis.label} + {score.label}")
                continue
            tell(f"refitting with {first.hypothesis.label} + {score.label}")
            if (pair := _refitted(fitter, first, score)) is not None:
                refits.append(pair)
    if not refits:
        return found
    return settle(replace(found, refits=[*found.refits, *refits]), clock, tell)


def _firsts(singles: list[Refit]) -> list[Refit]:
    """The best, of different laws."""
    by_law = {r.hypothesis.effects[0][0]: r for r in reversed(singles)}
    return [r for r in singles if by_law[r.hypothesis.effects[0][0]] is r][:_FIRSTS]


def _partners(found: Survey, first: Refit) -> list[Score]:
    """Scores beside the first effect, its own numbers moving with the nuisances."""
    seen = found.evidence
    rows = seen.rows(first.u, first.left, first.slopes)
    own = seen.white(first.columns)
    scorer = Scorer(
        replace(
            rows,
            slopes=np.concatenate([rows.slopes, own], axis=1),
            pull=np.concatenate([rows.pull, np.zeros(own.shape[1])]),
            sigma=np.concatenate([rows.sigma, np.full(own.shape[1], np.inf)]),
        )
    )
    effect, place = first.hypothesis.effects[0]
    same = {label for twins in found.twins.values() for label in twins}
    others = [
        replace(s, gain=scorer(seen.white(s.signature.columns)))
        for s in found.scores
        if s.label not in same
        and s.signature.hypothesis.effects[0] != (effect, place)
        and not (place == s.signature.hypothesis.effects[0][1] and _contains(s, effect))
    ]
    worth = [s for s in others if s.gain.gain / found.inflation > _WORTH]
    return sorted(worth, key=lambda s: -s.gain.gain)[:_SECONDS]


def _contains(score: Score, effect: str) -> bool:
    """Whether one law of friction contains the other."""
    own = score.signature.hypothesis.effects[0][0]
    return own in CONTAINS or (effect in CONTAINS and own in CONTAINS[effect])


def _refitted(fitter: Fitter, first: Refit, score: Score) -> Refit | None:
    try:
        trial = fitter.tried(first.hypothesis + score.signature.hypothesis, _starts(first, score))
    except ValueError:
        return None  # two effects that can't sit there together
    return fitter(trial, first.slopes) if trial is not None else None


def _starts(first: Refit, score: Score) -> Iterator[Start]:
    m = len(first.u)
    whole = score.gain.moved
    beside = replace(score, gain=replace(score.gain, moved=whole[:m]))
    for start in near(beside, first):
        yield Start(start.u, {**first.values(), **start.values})
