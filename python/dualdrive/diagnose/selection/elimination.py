"""Backward elimination: what came first may stand for what came later.

(Draper, Smith, Applied Regression Analysis, 3rd ed., 15.)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.hypotheses import is_strength
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.ranking import Ranking
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, Variant, carried, values

Array = NDArray[np.float64]


class Elimination:
    """Takes effects out of a leader again.

    Attributes:
        estimator: of the machine.
        library: what variants are made of.
        grey: the records.
        ranking: what is known on them; what is found without an effect is kept there.
        tell: progress.
        few: stretches of the records: what is far behind on them is so on all samples.

    """

    def __init__(
        self,
        estimator: Estimator,
        library: Library,
        grey: GreyBox,
        ranking: Ranking,
        tell: Callable[[str], None],
        few: GreyBox | None = None,
    ) -> None:
        self.estimator, self.library = estimator, library
        self.grey, self.ranking, self.tell, self.few = grey, ranking, tell, few

    def eliminated(self, leader: Fitted, proven: int = 0) -> Fitted:
        """The leader without what it does not need.

        Args:
            leader: what stands so far.
            proven: of them, how many that came last have just proved themselves.

        """
        while len(leader.variant.effects) > proven:
            count = len(leader.variant.effects) - proven
            rest = (self.library.without(leader.variant, e) for e in leader.variant.effects[:count])
            found = (self._from(leader, variant) for variant in rest if variant is not None)
            fewer = [f for f in found if f is not None]
            self.ranking.keep(fewer)
            best = min(fewer, key=self.ranking.criterion, default=None)
            if best is None or self.ranking.criterion(best) > self.ranking.criterion(leader):
                break
            leader = self.ranking[best.variant.key]
        return leader

    def narrowed(self, leader: Fitted) -> Fitted:
        """The leader with its effects at one member of a group where that is all it takes.

        Where every member of a group has numbers of its own they may be nought but for one.
        """
        for effect in leader.variant.effects:
            member = _strongest(leader, effect)
            variant = self.library.at_one(leader.variant, effect, member) if member else None
            found = self._from(leader, variant) if variant else None
            if found is None:
                continue
            self.ranking.keep([found])
            if self.ranking.criterion(found) < self.ranking.criterion(leader):
                leader = found
        return leader

    def _from(self, leader: Fitted, variant: Variant) -> Fitted | None:
        """A variant with less in it, from the numbers of a leader; None where it is far behind.

        What would not come up to the leader under its noise would not under a noise of its own.
        """
        self.tell(f"{variant.key} from the numbers of {leader.variant.key}")
        more = len(leader.variant.extra) - len(variant.extra)
        allowed = (threshold("beyond") + more * self.ranking.price()) * leader.inflation
        theta = carried(leader.point, variant, np.zeros(self.grey.shared + len(variant.extra)))
        for grey in [self.few, self.grey] if self.few else [self.grey]:
            if grey.counter.stop():
                return None
            [own] = grey.likelihoods(leader.variant, [(leader.point.theta, leader.noise)])
            if own is None:
                continue
            rival = own[0].minus_two_log + allowed
            there = self.estimator.under(grey, variant, [theta], leader.noise, rival=rival)
            if there is None or there.point.minus_two_log > rival:
                return None
            theta = there.point.theta
        return self.estimator.likeliest(self.grey, variant, theta, leader.noise)

    def simpler(self, richer: Fitted, simpler: Fitted) -> list[Fitted]:
        """The simpler one from the numbers found with more effects, where it is likelier there.

        What is gained by an effect is told against the simpler machine at its own best, which a
        search from the data sheet may have missed: its numbers, or its noise.
        """
        self.tell(f"{simpler.variant.key} from the numbers of {richer.variant.key}")
        theta = richer.point.theta[: len(simpler.point.theta)]
        fits = [
            self.estimator.under(self.grey, simpler.variant, [theta], noise)
            for noise in (simpler.noise, richer.noise)
        ]
        there = min(filter(None, fits), key=lambda f: f.point.minus_two_log, default=None)
        if there is None or not _clearly(there, simpler):
            return []
        found = self.estimator.likeliest(self.grey, simpler.variant, there.point.theta, there.noise)
        return [found] if found else []


def _strongest(f: Fitted, effect: tuple[str, str]) -> str:
    """Of a group, the member at which an effect is strongest; empty where all have the same."""
    name, place = effect
    shared = len(f.point.theta) - len(f.variant.extra)
    sizes: dict[str, float] = {}
    for path, size in values(f.variant.extra, f.point.theta[shared:]).items():
        label = path.rpartition(".")[0]
        member = label.removeprefix(f"{name}@")
        if member not in (label, place) and is_strength(f.variant.grown, path):
            sizes[member] = max(sizes.get(member, 0.0), abs(size))
    return max(sizes, key=lambda member: sizes[member]) if len(sizes) > 1 else ""


def _clearly(f: Fitted, other: Fitted) -> bool:
    """Whether it is likelier than another fit of its variant, by more than where fits end."""
    ahead = other.point.minus_two_log - f.point.minus_two_log
    return ahead > threshold("clearly") * other.inflation
