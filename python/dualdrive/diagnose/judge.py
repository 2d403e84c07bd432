"""From a survey to a verdict: whether anything is missing, and whether one name fits alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.candidates import rubs, station
from dualdrive.diagnose.free_torque import Course
from dualdrive.diagnose.heldout import held_out
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
Reason = Literal[
    "", "gains", "explains", "bound", "bent", "shape", "course", "clipped", "contradicted"
]

#: fall of the criterion below which nothing is named: odds of 1 to e^10 before the library's size
NAMED = 20.0
#: more of it in the closed loop: an encoder's steps are a law of its angle, too, and no noise
STEPS = 5.0
#: share of what a free input could explain, below which a name explains too little
EXPLAINED = 0.75
#: share of a pair's gain that its second law of friction must bring to be one of its own
BENT = 0.02
#: how often a leader is all there is though a torque of another course is surely left; by hand
BESIDE_A_COURSE = 0.3
#: of the rarest course's gain: where another acts is hardly told apart
AS_STRONG = 0.5
#: share of its gain that a name must keep where each stretch is foretold from the others
KEPT = 0.25
#: residual over floor, RMS, from which something is surely left
LEFT_OVER = 1.22
FAR_OVER = 1.35  # in one series alone
BALANCE = 1.8  # wider in a torque balance: a filtered contact is not quite a contact


@dataclass(frozen=True, eq=False)
class Judgement:
    """A verdict and the figures it rests on.

    ranked:    (refit, probability), nothing missing left out, best first
    nothing:   probability that nothing of the library is missing, among what was tried
    group:     labels that can't be told from the leader, the leader first
    explained: share of what could be explained that the leader explains
    excess:    largest residual over floor of any series, refitted and with the leader
    gain:      fall of the criterion; why: the leader gets no name, where it gets none
    course:    what a free torque surely explains of what is left, None where there is none
    """

    verdict: Verdict
    ranked: Sequence[tuple[Refit, float]]
    nothing: float
    group: tuple[str, ...]
    explained: float
    excess: tuple[float, float]
    gain: float
    why: Reason = ""
    course: Course | None = None


def judge(found: Survey, beside: Callable[[Refit], Sequence[Course]]) -> Judgement:
    """Judge a survey; probabilities count that the true cause may be none of those tried.

    beside: courses of a torque in what a refit leaves, the rarest first, none unless that is sure
    """
    judged = _with_course(found, _among_the_tried(found), beside)
    doubt = BALANCE if found.evidence.confrontation.mode == "balance" else 1.0
    right = how_often_right(1.0 + (judged.excess[1] - 1.0) / doubt, judged.explained)
    right *= 1.0 if judged.course is None else BESIDE_A_COURSE
    return replace(judged, ranked=[(r, right * p) for r, p in judged.ranked])


def _among_the_tried(found: Survey) -> Judgement:
    ranked, nothing = probabilities(found)
    base = found.base
    best = ranked[0][0] if ranked else base
    before = excess(found, found.plain.left)
    gain = found.criterion[key_of(base)] - found.criterion[key_of(best)]
    balance = found.evidence.confrontation.mode == "balance"
    needed = NAMED + 2.0 * math.log(max(len(found.scores), 1)) + (0.0 if balance else STEPS)
    after = excess(found, best.left)
    doubt = BALANCE if balance else 1.0
    explained = explained_by(found, best)
    figures = (explained, (float(before.max()), float(after.max())), gain)
    faint = balance and (explained < FAINT or not _is_above(before))
    if best is base or gain < needed or faint or not _foretells(found, best, gain):
        verdict: Verdict = "unknown" if _too_much(before, doubt) else _sound(found)
        return Judgement(verdict, ranked, nothing, (), *figures, "gains")
    several = len(best.hypothesis.effects) > 1  # picked from thousands: nothing may be left
    left = _too_much(after, doubt) or (several and (after.max() - 1.0) > doubt * (ENOUGH - 1.0))
    why: Reason = "explains" if explained < EXPLAINED and left else ""
    why = why or ("bound" if best.beyond() else "bent" if _bent(found, best) else "")
    if why:
        return Judgement("unknown", ranked, nothing, (), *figures, why)
    leader = ranked[0][0]
    group = tuple(dict.fromkeys((*leaders(ranked), *_twins(found, leader))))
    verdict = "effect" if ranked[0][1] >= SURE and len(group) == 1 else "ambiguous"
    return Judgement(verdict, ranked, nothing, group if len(group) > 1 else (), *figures)


def _with_course(
    found: Survey, judged: Judgement, beside: Callable[[Refit], Sequence[Course]]
) -> Judgement:
    """The same, a torque of another course counted that no law of the library has.

    Where nothing had a name something is missing, then. Where the leader has one it is not all;
    and where that torque follows what the leader itself does, the leader has not its shape.
    """
    if judged.verdict == "unknown":
        return judged
    named = judged.verdict in ("effect", "ambiguous")
    courses = beside(judged.ranked[0][0] if named else found.base)
    if not courses:
        return judged
    if not named:
        return replace(judged, verdict="unknown", why="course", course=courses[0])
    own = [x for x in courses if x.gain > AS_STRONG * courses[0].gain]
    bent = next((x for x in own if _is_own(x, judged.ranked[0][0])), None)
    if bent is not None:
        return replace(judged, verdict="unknown", group=(), why="shape", course=bent)
    return replace(judged, course=courses[0])


def _is_own(course: Course, leader: Refit) -> bool:
    """Whether it follows what the only law of the leader does, on the same drive train."""
    if len(leader.hypothesis.effects) > 1:
        return False
    [(effect, place)] = leader.hypothesis.effects
    own, other = station(place), station(course.place)
    there = own == other or (own == "drives" and other != "table")
    return rubs(effect) and course.kind == "speed" and there


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
