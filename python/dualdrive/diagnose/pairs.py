"""Two effects at once: what a good one leaves is scored again, and the best few are refitted.

Beside the leader all effects at groups of parts are tried anew, on the machine that has it: a
strong effect moves the machine so far that signatures taken without it tell little.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.candidates import members, tried_with
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.laws import CONTAINS
from dualdrive.diagnose.profiled import sharpened
from dualdrive.diagnose.refit import Fitter, Refit, Start, Trial
from dualdrive.diagnose.settle import ENOUGH, settle
from dualdrive.diagnose.stage import Score, Stage, scale_of
from dualdrive.diagnose.starts import beside
from dualdrive.diagnose.survey import Survey, excess, explained_share, key_of
from dualdrive.diagnose.work import Work, first_of_each, misfit_left

Array = NDArray[np.float64]

#: floors are reckoned, not seen: share of what is above them below which nothing is named, nor a
#: second effect beside a first
FAINT = 0.5
_FIRSTS, _SECONDS = 2, 3  # effects to begin with, and partners of each
_TAKEN_APART = 3  # best groups of which the single parts are tried, too
_NEAR = 0.5  # of the leader's gain: what has less is no first effect of a pair
_KNOWN = 2  # partners beside the leader by the scores without it
_WORTH = 15.0  # expected fall of chi^2 over its inflation for which a second effect is tried
_SURELY = 45.0  # the same, for which it is tried though no more than noise seems left


def with_pairs(found: Survey, work: Work) -> Survey:
    """Refit pairs where the best single effect leaves what another would take.

    Where it leaves no more than noise a second effect must be sure by its score.
    """
    singles = [r for r in found.refits if len(r.hypothesis.effects) == 1]
    singles.sort(key=lambda r: found.criterion[key_of(r)])
    if not singles or found.best is found.base or not work.clock.allows("two effects at once"):
        return found
    faint = bool(excess(found, found.best.left).max() < ENOUGH)
    fitter, refits, known = Fitter(found.evidence, work.stop), list[Refit](), set[frozenset[str]]()
    for number, first in enumerate(_firsts(found, singles)):
        partners = _partners(found, first, found.scores)
        if number == 0:
            partners = [*_anew(found, first, partners, faint, work), *partners[:_KNOWN]]
        if faint:
            partners = [s for s in partners if _is_sure(found, s)]
        for score in partners:
            both = frozenset((first.hypothesis.label, score.label))
            if both in known:
                continue
            known.add(both)
            if work.stop():
                work.clock.leave_out(f"not refitted: {first.hypothesis.label} + {score.label}")
                continue
            work.tell(f"refitting with {first.hypothesis.label} + {score.label}")
            pair = _refitted(fitter, first, score)
            if pair is not None and not _is_idle(found, first, pair):
                refits.append(pair)
                remark = misfit_left(pair.chi, found.base.chi)
                work.leader.meets(pair.hypothesis.label, pair.chi, remark)
        if any(excess(found, pair.left).max() < ENOUGH for pair in refits):
            break  # nothing is left to explain
    if not refits:
        return found
    return settle(replace(found, refits=[*found.refits, *refits]), work)


def _is_idle(found: Survey, first: Refit, pair: Refit) -> bool:
    """Whether the second effect leaves most of what the first leaves above the floor.

    Something else is missing then, and with numbers to spend many laws take a little of it.
    """
    before, after = excess(found, first.left), excess(found, pair.left)
    return explained_share(before, after) < FAINT


def _is_sure(found: Survey, score: Score) -> bool:
    """Whether another effect would take so much, though no more than noise seems left."""
    return score.gain.gain / found.inflation > _SURELY


def _anew(
    found: Survey, first: Refit, partners: Sequence[Score], faint: bool, work: Work
) -> list[Score]:
    """The best beside the first effect, all tried on the machine that has it.

    partners: by the scores without it; faint: whether hardly more than noise is left, so that no
        spectrum shows an order, and one of them must be sure first
    """
    if faint and not any(_is_sure(found, s) for s in partners[:1]):
        return []
    work.tell(f"trying what {first.hypothesis.label} leaves")
    return _partners(found, first, _beside(found, first, faint, work))


def _beside(found: Survey, first: Refit, low: bool, work: Work) -> list[Score]:
    """All effects tried on the machine that has the first; none where time is up."""
    c, seen = copy(found.evidence.confrontation), found.evidence
    c.core = first.machine
    stage = Stage(c, first.u, first.left, [scale_of(seen, first)], work)
    every = tried_with(c, c.core)
    scores = stage.scores(stage.listed([h for h in every if _plain(h)], low))
    best = sorted(scores, key=lambda s: -s.gain.gain)[:_TAKEN_APART]
    groups = dict.fromkeys(s.signature.hypothesis.effects for s in best)
    parts = [m for effects in groups for m in members(c.core, Hypothesis(effects))]
    scores += stage.scores(stage.listed(parts, low))
    if work.stop():
        work.clock.leave_out(f"not all was tried beside {first.hypothesis.label}")
    return scores


def _plain(h: Hypothesis) -> bool:
    """Whether it is no whole law of friction: beside another effect the simple ones will do."""
    return h.effects[-1][0] not in CONTAINS


def _firsts(found: Survey, singles: Sequence[Refit]) -> list[Refit]:
    """The best, of laws that do not contain one another, and what gains about as much."""
    chosen: list[Refit] = []
    for r in singles:
        law = r.hypothesis.effects[0][0]
        known = [other.hypothesis.effects[0][0] for other in chosen]
        if not any(
            law == k or law in CONTAINS.get(k, ()) or k in CONTAINS.get(law, ()) for k in known
        ):
            chosen.append(r)
    none = found.criterion[key_of(found.base)]
    gains = [none - found.criterion[key_of(r)] for r in chosen]
    return [r for r, g in zip(chosen, gains, strict=True) if g >= _NEAR * gains[0]][:_FIRSTS]


def _partners(found: Survey, first: Refit, scores: Sequence[Score]) -> list[Score]:
    """The best beside the first effect."""
    scale = scale_of(found.evidence, first)
    effect, place = first.hypothesis.effects[0]
    same = {label for twins in found.twins.values() for label in twins}
    others = [
        replace(s, gain=scale.gain(s.signature))
        for s in scores
        if s.label not in same
        and not _again(first, s)
        and not (place == s.signature.hypothesis.effects[0][1] and _contains(s, effect))
    ]
    worth = [s for s in others if s.gain.gain / found.inflation > _WORTH]
    worth.sort(key=lambda s: -s.gain.gain)
    return first_of_each(worth, lambda s: s.label)[:_SECONDS]


def _again(first: Refit, score: Score) -> bool:
    """Whether it is the law of the first once more, at a part that has it already."""
    effect = score.signature.hypothesis.effects[0][0]
    if effect != first.hypothesis.effects[0][0]:
        return False
    parts = [set(grown.effects[-1]["members"]) for grown in (first.grown, score.signature.grown)]
    return bool(parts[0] & parts[1]) or score.label == first.hypothesis.label


def _contains(score: Score, effect: str) -> bool:
    """Whether one law of friction contains the other."""
    own = score.signature.hypothesis.effects[0][0]
    return own in CONTAINS or (effect in CONTAINS and own in CONTAINS[effect])


def _refitted(fitter: Fitter, first: Refit, score: Score) -> Refit | None:
    starts = beside(score, first.u, first.values())
    trial = together(fitter, first.hypothesis + score.signature.hypothesis, starts)
    return sharpened(fitter, fitter(trial, first.slopes)) if trial is not None else None


def together(
    fitter: Fitter, both: Hypothesis, starts: Iterable[Start], slopes: Sequence[Array] = ()
) -> Trial | None:
    """The best of the starts; None where two effects can't sit there together, or time is up."""
    try:
        return fitter.tried(both, starts, slopes=slopes)
    except ValueError:
        return None
