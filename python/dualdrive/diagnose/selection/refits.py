"""Which scores are worth a refit, and the refits under their leader's noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.screening import Scored
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.parts import is_part, part_refitted, part_score
from dualdrive.diagnose.thresholds import threshold
from dualdrive.innovations import GreyBox, Point, Variant, fit

Array = NDArray[np.float64]


def worth_refitting(found: Sequence[Scored], most: int) -> list[Scored]:
    """The best scores, and what they may be taken for.

    Args:
        found: score tests beside one leader.
        most: how many of the best.

    """
    known = [s for s in found if np.isfinite(s.gain)]
    known.sort(key=lambda s: -(s.gain - 2.0 * np.log(s.variant.looks)))
    hopeful, orders = list[Scored](), dict[str, int]()
    for s in known:
        orders[s.variant.label] = orders.get(s.variant.label, 0) + 1
        if s.gain > threshold("hopeless") and orders[s.variant.label] <= threshold("orders"):
            hopeful.append(s)
    best = hopeful[:most]
    # and what the best are taken for, whose own score may be faint while another law is missing
    rivals = [
        s
        for s in known
        if s.gain > 0.0 and s not in best and any(confused(b.variant, s.variant) for b in best)
    ]
    return best + rivals[: most // 2]


def refitted(
    estimator: Estimator, grey: GreyBox, leader: Fitted, s: Scored, columns: Sequence[Array]
) -> Point:
    """A law at its best under its leader's noise; `lost` where that is nowhere, or hopeless.

    Args:
        estimator: of the machine.
        grey: the records.
        leader: beside which the law was scored.
        s: its score.
        columns: derivatives of the leader's innovations by all its unknowns.

    """
    point, variant = leader.point, s.variant
    start = np.r_[point.theta, grey.start(variant)[len(point.theta) :]]
    for k, p in enumerate(variant.extra, grey.shared):
        if p.path in s.start:
            start[k] = p.coordinate(min(max(s.start[p.path], p.low), p.high))
    if not is_part(variant):
        shared = columns[: grey.shared]
        return fit(grey, variant, start, leader.gains, steps=5, shared_columns=shared, refresh=(2,))
    lost = replace(point, variant=variant, lost=True)
    if not part_score(grey, point, columns, variant, leader.noise) > threshold("hopeless"):
        return lost
    # from the data sheet: the part may stand for what the numbers had stood for
    start[: grey.shared] = grey.start(Variant(estimator.core))
    known = len(point.theta)
    return part_refitted(estimator, grey, variant, start, known, leader.noise) or lost


def with_rivals(ranked: Sequence[Point], most: int) -> list[Point]:
    """The best of each label, and as many of what the library says they are taken for.

    Args:
        ranked: refits, best first.
        most: how many of either.

    """
    labels: dict[str, Point] = {}
    for p in ranked:
        labels.setdefault(p.variant.label, p)  # orders of one law are one law
    own = list(labels.values())
    best, rest = own[:most], own[most:]
    return best + [p for p in rest if any(confused(q.variant, p.variant) for q in best)][:most]


def confused(known: Variant, other: Variant) -> bool:
    """Whether the library declares the other's last law as what the known one's is taken for."""
    (effect, place), (rival, at) = known.effects[-1], other.effects[-1]
    declared: Any = _core.effect_type(effect).confused_with
    return place == at and rival in str(declared).split(",")
