"""From a survey to a verdict: whether anything is missing, and whether one name fits alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.heldout import held_out
from dualdrive.diagnose.laws import rubs
from dualdrive.diagnose.pairs import FAINT
from dualdrive.diagnose.probability import (
    SURE,
    brought,
    how_often_right,
    leaders,
    probabilities,
)
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.result import Verdict
from dualdrive.diagnose.settle import ENOUGH
from dualdrive.diagnose.survey import Survey, excess, explained_by, key_of

Array = NDArray[np.float64]
#: why the best of what was tried gets no name
Reason = Literal["", "gains", "explains", "bound", "bent", "clipped", "contradicted"]

#: fall of the criterion below which nothing is named: odds of 1 to e^10 before the library's size
NAMED = 20.0
#: share of what a free input could explain, below which a name explains too little
EXPLAINED = 0.75
#: share of a pair's gain that its second law of friction must bring to be one of its own
BENT = 0.02
#: share of its gain that a name must keep where each stretch is foretold from the others
KEPT = 0.25
#: residual over floor, RMS, from which something is surely left
LEFT_OVER = 1.22
FAR_OVER = 1.35  # in one series alone
DOUBT = 1.8  # times as far above the floor: a filtered contact is not quite a contact


@dataclass(frozen=True, eq=False)
class Judgement:
    """A verdict and the figures it rests on.

    ranked:    (refit, probability), nothing missing left out, best first
    nothing:   probability that nothing of the library is missing, among what was tried
    group:     labels that can't be told from the leader, the leader first
    explained: share of what could be explained that the leader explains
    excess:    largest residual over floor of any series, refitted and with the leader
    gain:      fall of the criterion; why: the leader gets no name, where it gets none
    """

    verdict: Verdict
    ranked: Sequence[tuple[Refit, float]]
    nothing: float
    group: tuple[str, ...]
    explained: float
    excess: tuple[float, float]
    gain: float
    why: Reason = ""


def judge(found: Survey) -> Judgement:
    """Judge a survey; probabilities count that the true cause may be none of those tried."""
    judged = _among_the_tried(found)
    right = how_often_right(1.0 + (judged.excess[1] - 1.0) / DOUBT, judged.explained)
    return replace(judged, ranked=[(r, right * p) for r, p in judged.ranked])


def _among_the_tried(found: Survey) -> Judgement:
    ranked, nothing = probabilities(found)
    base = found.base
    best = ranked[0][0] if ranked else base
    before = excess(found, found.plain.left)
    gain = found.criterion[key_of(base)] - found.criterion[key_of(best)]
    needed = NAMED + 2.0 * math.log(max(len(found.scores), 1))
    after = excess(found, best.left)
    explained = explained_by(found, best)
    figures = (explained, (float(before.max()), float(after.max())), gain)
    faint = explained < FAINT or not _is_above(before)
    if best is base or gain < needed or faint or not _foretells(found, best, gain):
        verdict: Verdict = "unknown" if _too_much(before) else _sound(found)
        return Judgement(verdict, ranked, nothing, (), *figures, "gains")
    several = len(best.hypothesis.effects) > 1  # picked from thousands: nothing may be left
    left = _too_much(after) or (several and (after.max() - 1.0) > DOUBT * (ENOUGH - 1.0))
    why: Reason = "explains" if explained < EXPLAINED and left else ""
    why = why or ("bound" if best.beyond() else "bent" if _bent(found, best) else "")
    if why:
        return Judgement("unknown", ranked, nothing, (), *figures, why)
    leader = ranked[0][0]
    group = tuple(dict.fromkeys((*leaders(ranked), *_twins(found, leader))))
    verdict = "effect" if ranked[0][1] >= SURE and len(group) == 1 else "ambiguous"
    return Judgement(verdict, ranked, nothing, group if len(group) > 1 else (), *figures)


def _bent(found: Survey, best: Refit) -> bool:
    """Whether the second of two laws of friction does no more than bend the curve of the first.

    Then neither is the law: with a cubic damper a square one leaves a little, which some other
    friction takes.
    """
    if len(best.hypothesis.effects) < 2 or not all(rubs(e) for e, _ in best.hypothesis.effects):
        return False
    return brought(found, best)[1] < BENT


def _twins(found: Survey, best: Refit) -> list[str]:
    """Other laws that do the very same as the leader on these records."""
    return [
        label
        for effect, place in best.hypothesis.effects
        for label in found.twins.get(f"{effect}@{place}", ())
        if label.partition("@")[0] != effect
    ]


def _foretells(found: Survey, best: Refit, gain: float) -> bool:
    """Whether what the leader gains it gains on stretches it was not fitted to, too."""
    seen = found.evidence
    with_it, without = (seen.white(held_out(seen, r)) for r in (best, found.base))
    return float(without @ without - with_it @ with_it) / found.inflation > KEPT * gain


def _is_above(ratios: Array) -> bool:
    """Whether anything stands above the floors at all."""
    return bool(ratios.max() > 1.0)


def _too_much(ratios: Array) -> bool:
    """Whether more is left than the sensors leave, in more than one series or by far in one."""
    ordered = np.sort(ratios)[::-1]
    second = ordered[1] if len(ordered) > 1 else 0.0
    return bool(ordered[0] > DOUBT * FAR_OVER or second > DOUBT * LEFT_OVER)


def _sound(found: Survey) -> Verdict:
    """Adequate as it came, or only after its numbers moved."""
    seen = found.evidence
    nominal = seen.chi(found.nominal.u, found.nominal.left)
    fall = (nominal - found.base.chi) / found.inflation
    return "parameters" if fall > NAMED + len(found.base.u) else "adequate"
