"""Refits of parts that are put in: shafts, play, limits, dead times, bristles.

A part is scored beside the leader at several sizes first, as laws are; where that says nothing,
nothing is refitted. A part softens or frees what the numbers of the machine had stood for: its
refit begins from the data sheet, at the sizes that are likeliest where any machine follows. One
that does not show there, as bristles do not while much unknown torque bears what they do, begins
as a law does, beside the leader, if its score alone would name it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.laws import clips, is_late
from dualdrive.diagnose.screening import residual_maker
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.estimation.thresholds import threshold
from dualdrive.estimation.unknowns import Unknown
from dualdrive.innovations import (
    GreyBox,
    Noise,
    Place,
    Point,
    Variant,
    coordinates,
    flat,
    inflation,
)

Array = NDArray[np.float64]

#: where the first number of a joint begins, times its usual one: a valley of a play is half as wide
_JOINT = tuple(1.5**k for k in range(-6, 7))
_LIMIT = (0.3, 1.0)  # and that of a limit or a lag, whose likelihood has no valleys
#: times its score's size: a limit that is too low is met where the machine went on, and no filter
#: follows; from above it is approached
_FROM_ABOVE = (1.0, 1.1, 1.2, 1.3)
_TRIED = (3.0, 1.0, 0.3, 0.1)  # times its usual one: sizes at which a part is scored
#: the same of a delay: in a sampled loop it acts from tick to tick, so that its likelihood is level
#: between two of them and no slope leads from one to the next
_LATE = tuple(1.5**k for k in range(2, -12, -1))
#: the same of a limit, times what all but half a per cent of the samples lie below: it may be met
#: in fewer, and noise goes beyond it
_AT_A_LIMIT = (0.93, 0.965, 1.0, 1.04, 1.08, 1.15, 1.22, 1.3, 1.5, 1.75, 2.0)


def is_joint(variant: Variant) -> bool:
    """Whether its last effect is a joint that gives: stiffness and play have valleys."""
    return bool(variant.effects and _core.effect_type(variant.effects[-1][0]).brings)


def brings(joint: Variant, other: Variant) -> bool:
    """Whether a joint comes with a law that the other one has: a shaft damps as it gives."""
    own = str(_core.effect_type(joint.effects[-1][0]).brings)
    return any(effect == own for effect, _ in other.effects)


def may_be_missing(part: Variant, quiet: Sequence[Variant]) -> bool:
    """Whether a part may be missing beside laws that leave noise, or where none does.

    A joint would describe that noise, unless one of them comes with it. Bristles or a limit may be
    what a law that leaves noise describes in part.
    """
    return not quiet or not is_joint(part) or any(brings(part, law) for law in quiet)


def _factors(part: Variant, size: Unknown) -> Sequence[float]:
    """Times its usual size: where a part is scored. size: its first number."""
    if clips(part.effects[-1][0]):
        return _AT_A_LIMIT
    return _LATE if _is_delay(size) else _TRIED


def _is_delay(size: Unknown) -> bool:
    return size.strength and size.unit == "s"


class PartScore(NamedTuple):
    """Score of a part beside a leader.

    gain:  fall of -2 log L that it promises, over the leader's inflation; 0 where it promises none
    start: the leader's numbers and the part's, as its score has them, shape (unknowns,)
    """

    gain: float
    start: Array


def part_score(
    grey: GreyBox,
    point: Point,
    columns: Sequence[Array],
    variant: Variant,
    noise: Noise,
) -> PartScore:
    """Score of a part beside a leader, over what the leader's innovations count themselves.

    The change of the innovations that a part of some size makes, its gains its own, less what the
    leader's numbers could do as well, is its regressor; the best of several sizes counts. One-sided
    like the score of a law: no part is there to a negative degree.

    What a late sensor does is no multiple of what it does at another size, and it moves noise from
    one sample to another. Of it counts what is left once the leader's numbers have answered.

    Args:
        grey: the records.
        point: the leader.
        columns: derivatives of its innovations by all its unknowns.
        variant: the leader with the part in it, last of its effects.
        noise: the leader's.

    """
    known, r = len(point.theta), flat(point.residuals)
    apart = residual_maker(columns, grey.believed(point.variant)[1])
    rest, places = apart(r), []
    for factor in _factors(variant, variant.extra[known - grey.shared]):
        there = np.r_[point.theta, coordinates(variant.extra[known - grey.shared :], {})]
        there[known] *= factor
        places.append((there, noise))
    best, start = 0.0, places[0][0]
    least, size = float(rest @ rest) + point.log_det, variant.extra[known - grey.shared]
    for (there, _), found in zip(places, grey.likelihoods(variant, places), strict=True):
        if found is None:
            continue
        theirs = flat(found[0].residuals)
        if is_late(_core.effect_type(variant.effects[-1][0])):
            answered = apart(theirs)
            gain, begin = least - float(answered @ answered) - found[0].log_det, there
        else:
            change = apart(theirs - r)
            norm = max(float(np.linalg.norm(change)), 1e-300)
            along = -float(change @ rest) / norm
            gain, begin = max(along, 0.0) ** 2, there.copy()
            if size.strength:  # as much of it as the rest asks for
                begin[known] *= along / norm
        if gain > best:
            best, start = gain, begin
    return PartScore(best / inflation(point), start)


def part_refitted(
    estimator: Estimator,
    grey: GreyBox,
    variant: Variant,
    start: Array,
    rest: Variant,
    noise: Noise,
    scored: float,
) -> Place | None:
    """Where a part comes near its best; None where no replay follows, or nothing speaks for it.

    From the sizes that are likeliest under much unknown torque, if the data sheet's machine is
    likelier with the part than without it there.

    Args:
        estimator: of the machine.
        grey: the records.
        variant: the machine with the part in it, last of its effects.
        start: its numbers, those of the data sheet as they are there, shape (unknowns,).
        rest: the machine without it, whose numbers come first.
        noise: under which the leader stands.
        scored: the part's first number, as its score has it.

    """
    begins, known = list[Array](), grey.shared + len(rest.extra)
    sizes = [factor * start[known] for factor in (_JOINT if is_joint(variant) else _LIMIT)]
    if clips(variant.effects[-1][0]):
        sizes += [factor * scored for factor in _FROM_ABOVE]
    if _is_delay(variant.extra[known - grey.shared]):
        sizes.append(scored)
    sizes = sorted(sizes)
    for size in sizes:
        there = start.copy()
        there[known] = size
        begins.append(there)
    wide = replace(noise, torque=estimator.wide.torque)
    seen = grey.likelihoods(variant, [(x, wide) for x in begins])
    heights = [f[0].minus_two_log if f else np.inf for f in seen]
    [without] = grey.likelihoods(rest, [(start[:known], wide)])
    least = without[0].minus_two_log if without else np.inf
    near = [k for k in _valleys(heights) if heights[k] < least][: int(threshold("valleys"))]
    found = (estimator.likeliest(grey, variant, begins[k], noise, roughly=True) for k in near)
    best = min((f for f in found if f), key=lambda f: f.point.minus_two_log, default=None)
    return (best.point, best.noise) if best else None


def _valleys(heights: Sequence[float]) -> list[int]:
    """Where a row of heights is lower than on both sides, lowest first; of sorted sizes."""
    walled = [np.inf, *heights, np.inf]
    low = [
        k for k, h in enumerate(heights) if np.isfinite(h) and h <= walled[k] and h <= walled[k + 2]
    ]
    return sorted(low, key=lambda k: heights[k])
