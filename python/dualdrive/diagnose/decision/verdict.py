"""Verdict and probabilities from likelihoods, and from the torque that stays unexplained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dualdrive.diagnose.decision.sanity import enough_for
from dualdrive.diagnose.result import Verdict
from dualdrive.diagnose.selection import (
    Fitted,
    MissingTorque,
    Selection,
    missing_torque,
    suffices,
)
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox


@dataclass(frozen=True, eq=False)
class Decision:
    """What may be said.

    ranked:  fitted hypotheses with their probabilities, best first, `nothing` among them
    group:   labels that can't be told apart, the leader first; empty unless several are possible
    missing: equation -> torque that the refitted machine lacks
    left:    the same beside the leader
    """

    verdict: Verdict
    ranked: Sequence[tuple[Fitted, float]]
    group: tuple[str, ...] = ()
    missing: Mapping[str, MissingTorque] = field(default_factory=dict)
    left: Mapping[str, MissingTorque] = field(default_factory=dict)

    @property
    def best(self) -> Fitted:
        """The leader."""
        return self.ranked[0][0]

    def stands(self, found: Selection) -> Fitted:
        """What the answer rests on: the leader where it has a name, else refitted numbers alone."""
        return self.best if self.verdict in ("effect", "ambiguous") else found.base


def decide(core: Any, grey: GreyBox, found: Selection, sure: Uncertainty) -> Decision:
    """Say no more than a search allows."""
    ranked = probabilities(found)
    best = found.best
    missing = missing_torque(core, grey, found.base)
    left = missing_torque(core, grey, best)
    if not found.finished:
        return Decision("unfinished", ranked, (), missing, left)
    if not suffices(core, grey, best, left) or best.inflation > threshold("inflation"):
        return Decision("unknown", ranked, (), missing, left)
    if not best.variant.effects:
        return Decision(_of_numbers(sure, best), ranked, (), missing, left)
    possible = [f for f, p in ranked if p >= threshold("possible") and f.variant.effects]
    group = tuple(dict.fromkeys(f.variant.label for f in possible))
    certain = ranked[0][1] >= threshold("certain")
    verdict: Verdict = "effect" if certain or len(group) < 2 else "ambiguous"
    return Decision(verdict, ranked, group if verdict == "ambiguous" else (), missing, left)


def numbers_alone(sure: Uncertainty, found: Selection, decision: Decision) -> Decision:
    """Where these leave noise, too, and what is likelier does not bear its name."""
    others = [(f, 0.0) for f, _ in decision.ranked if f is not found.base]
    verdict = _of_numbers(sure, found.base)
    return Decision(verdict, [(found.base, 1.0), *others], (), decision.missing, decision.missing)


def probabilities(found: Selection) -> list[tuple[Fitted, float]]:
    """Weights of the criterion, one for each law, whatever its order: that of its best fit.

    Several laws are the same in whatever turn they were put in.
    """
    criteria = np.array([f.criterion for f in found.finals])
    weights = np.exp(-0.5 * (criteria - criteria.min()))
    weights /= weights.sum()
    best: dict[frozenset[tuple[str, str]], Fitted] = {}
    shares: dict[frozenset[tuple[str, str]], float] = {}
    for f, w in zip(found.finals, weights, strict=True):
        laws = frozenset(f.variant.effects)
        best.setdefault(laws, f)
        shares[laws] = shares.get(laws, 0.0) + float(w)
    return [(f, shares[laws]) for laws, f in best.items()]


def _of_numbers(sure: Uncertainty, f: Fitted) -> Verdict:
    """Whether the data sheet's numbers had to move beyond doubt."""
    enough = enough_for(len(sure.grey.nominal), sure.grey.samples)
    return "parameters" if sure.distance(f) > enough else "adequate"
