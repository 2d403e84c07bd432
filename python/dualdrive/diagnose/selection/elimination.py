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
            leader: several effects.
            proven: of them, how many that came last have just proved themselves.

        """
        while len(leader.variant.effects) > 1:
            fewer = []
            count = len(leader.variant.effects) - proven
            for effect in leader.variant.effects[:count]:
                variant = self.library.without(leader.variant, effect)
                if variant is None or self.grey.counter.stop():
                    continue
                self.tell(f"{variant.key} from the numbers of {leader.variant.key}")
                nothing = np.zeros(self.grey.shared + len(variant.extra))
                theta = carried(leader.point, variant, nothing)
                if self.few and self._needed_on(self.few, variant, theta, leader):
                    continue
                there = self.estimator.under(self.grey, variant, [theta], leader.noise)
                if there is None or self._far_behind(there, leader):
                    continue
                theta = there.point.theta
                found = self.estimator.likeliest(self.grey, variant, theta, leader.noise)
                fewer += [found] if found else []
            self.ranking.keep(fewer)
            best = min(fewer, key=self.ranking.criterion, default=None)
            if best is None or self.ranking.criterion(best) > self.ranking.criterion(leader):
                break
            leader = self.ranking[best.variant.key]
        return leader

    def _needed_on(self, few: GreyBox, fewer: Variant, theta: Array, leader: Fitted) -> bool:
        """Whether what a leader lacks without an effect is more than chance on few samples."""
        [own] = few.likelihoods(leader.variant, [(leader.point.theta, leader.noise)])
        there = self.estimator.under(few, fewer, [theta], leader.noise)
        if own is None or there is None:
            return False
        behind = (there.point.minus_two_log - own[0].minus_two_log) / leader.inflation
        more = len(leader.variant.extra) - len(fewer.extra)
        return behind - more * self.ranking.price() > threshold("beyond")

    def _far_behind(self, f: Fitted, leader: Fitted) -> bool:
        """Whether it would not come up to the leader under a noise of its own."""
        behind = self.ranking.criterion(f) - self.ranking.criterion(leader)
        return behind > threshold("beyond")

    def narrowed(self, leader: Fitted) -> Fitted:
        """The leader with its effects at one member of a group where that is all it takes.

        Where every member of a group has numbers of its own they may be nought but for one.
        """
        for effect in leader.variant.effects:
            member = _strongest(leader, effect)
            variant = member and self.library.at_one(leader.variant, effect, member)
            if not variant or self.grey.counter.stop():
                continue
            self.tell(f"{variant.key} from the numbers of {leader.variant.key}")
            nothing = np.zeros(self.grey.shared + len(variant.extra))
            theta = carried(leader.point, variant, nothing)
            if self.few and self._needed_on(self.few, variant, theta, leader):
                continue
            there = self.estimator.under(self.grey, variant, [theta], leader.noise)
            if there is None or self._far_behind(there, leader):
                continue
            found = self.estimator.likeliest(self.grey, variant, there.point.theta, leader.noise)
            if found is None:
                continue
            self.ranking.keep([found])
            if self.ranking.criterion(found) < self.ranking.criterion(leader):
                leader = found
        return leader

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
