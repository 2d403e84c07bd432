"""Forward selection of laws by likelihood, the noise estimated beside every leader.

A torque of unknown course bears what a model lacks: estimated by likelihood it is large where a
law is missing and small once the right one is in. A refit begins with much of it (any machine
follows the record then) and ends with the least that the records allow, where all of their
information counts
(Kristensen, Madsen, Jørgensen, Computers & Chemical Engineering 28 (2004) 1431-1449).

Long records are searched on stretches of them. What stands there is held against all samples; and
where no law stands there, all samples are searched for a faint one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.screening import Library, Scored, scores
from dualdrive.diagnose.selection.base import refitted_base
from dualdrive.diagnose.selection.estimation import Estimator, on_all_samples
from dualdrive.diagnose.selection.fitted import EFFORTS, Effort, Fitted, Selection
from dualdrive.diagnose.selection.parts import is_joint, is_part, part_score
from dualdrive.diagnose.selection.refits import refitted, with_rivals, worth_refitting
from dualdrive.diagnose.selection.residual_analysis import leaves_noise, white
from dualdrive.diagnose.thresholds import threshold
from dualdrive.diagnose.work import Leader
from dualdrive.innovations import GreyBox, Noise, Point, Variant, fit, inflation

Array = NDArray[np.float64]

_PAIR = 2  # effects, of which the first was chosen by what both leave together


def select(
    core: Any,
    grey: GreyBox,
    effort: Effort = EFFORTS["normal"],
    tell: Callable[[str], None] = lambda _: None,
) -> Selection:
    """Search the library; see the module."""
    return _Search(core, grey, effort, tell).run()


class _Search:
    def __init__(
        self, core: Any, grey: GreyBox, effort: Effort, tell: Callable[[str], None]
    ) -> None:
        self.core, self.whole, self.grey = core, grey, grey
        self.effort, self.told, self.leader = effort, tell, Leader()
        self.library = Library(core, grey)
        self.screened: list[tuple[str, Scored]] = []
        self.tried: dict[str, float] = {}
        self.finals: dict[str, Fitted] = {}
        self.looked_at: GreyBox | None = None  # on what laws have been sought
        self.noisy: dict[Fitted, bool] = {}  # whether what it leaves is noise
        self.estimator = Estimator(core, grey)

    def tell(self, what: str) -> None:
        """Say what is tried, and what is best so far."""
        self.told(f"{what}{self.leader}")

    def run(self) -> Selection:
        self.tell("refitting the data sheet's numbers")
        base, self.grey = refitted_base(self.estimator, self.whole)
        self._keep([base])
        stop = self.whole.counter.stop
        leader = self._forward(base)
        if self.grey is not self.whole and stop():
            self._replayed_on_all_samples(base)
        elif self.grey is not self.whole:
            leader = self._on_all_samples()
        if not leader.variant.effects and not stop():
            # joints first: what a soft shaft does a law of the drives would describe, too
            self._keep(self._joints(leader))
            leader = min(self.finals.values(), key=self._criterion)
            if self.looked_at is not self.grey or leader.variant.effects:
                leader = self._forward(leader)
        if not self.screened and not stop():
            self._scores(leader)
        self._weigh_drifting_zeros()
        own = (replace(f, criterion=self._criterion(f)) for f in self.finals.values())
        every = sorted(own, key=lambda f: f.criterion)
        order = sorted(self.screened, key=lambda s: -np.nan_to_num(s[1].gain, nan=-np.inf))
        base = next(f for f in every if f.variant.key == base.variant.key)
        done = not self.grey.counter.stop()
        return Selection(self.whole, base, every, order, self.tried, done)

    def _forward(self, leader: Fitted) -> Fitted:
        """Law by law, while they bring enough; the leader then."""
        self.looked_at = self.grey
        for count in range(self.effort.most - len(leader.variant.effects)):
            if self.grey.counter.stop():
                break
            if self._leaves_noise(leader):
                break
            found = self._step(leader, self._scores(leader), parts=count == 0)
            self._keep(found)
            if not any(map(self._leaves_noise, found)):
                self._keep(self._beside_the_runner_up(leader))
            if found:
                richer = min(found, key=self._criterion)
                if simpler := self._without(richer, leader.variant):
                    self._keep([simpler])
                leader = self.finals[leader.variant.key]
            best = min(self.finals.values(), key=lambda f: self._criterion(f))
            gained = self._criterion(leader) - self._criterion(best)
            if best is leader or gained < threshold("gain"):
                break
            leader = self._eliminated(best)
            self.leader.judged(leader.variant.key, f"gain {gained:.3g}")
            if len(leader.variant.effects) == _PAIR and not self._leaves_noise(leader):
                leader = self._swapped(leader)
        return leader

    def _beside_the_runner_up(self, leader: Fitted) -> list[Fitted]:
        """Pairs with the second-best law, where it is nearly as good alone as the leader.

        Of two laws that are both missing, what each takes of the other's share decides which leads.
        """
        singles = [f for f in self.finals.values() if len(f.variant.effects) == 1]
        if leader not in singles or self.grey.counter.stop():
            return []
        nothing = self._criterion(self.finals["nothing"])
        least = threshold("runner-up") * (nothing - self._criterion(leader))
        rivals = [f for f in singles if f is not leader and nothing - self._criterion(f) > least]
        if not rivals:
            return []
        second = min(rivals, key=self._criterion)
        return self._step(second, self._scores(second), parts=False)

    def _swapped(self, leader: Fitted) -> Fitted:
        """What came before the last effect taken out again, and others tried in its place."""
        for effect in leader.variant.effects[:-1]:
            rest = self.library.without(leader.variant, effect)
            if rest is None or rest.key not in self.finals or self.grey.counter.stop():
                continue
            fewer = self.finals[rest.key]
            self._keep(self._step(fewer, self._scores(fewer), parts=False))
        best = min(self.finals.values(), key=self._criterion)
        if self._criterion(leader) - self._criterion(best) < threshold("gain"):
            return leader
        self.leader.judged(best.variant.key, "instead")
        return self._eliminated(best)

    def _eliminated(self, leader: Fitted) -> Fitted:
        """Backward elimination: what was first may stand for what came later.

        (Draper, Smith, Applied Regression Analysis, 3rd ed., 15.)
        """
        while len(leader.variant.effects) > 1:
            fewer = []
            for effect in leader.variant.effects[:-1]:  # the last one has just proved itself
                variant = self.library.without(leader.variant, effect)
                if variant is None or self.grey.counter.stop():
                    continue
                self.tell(f"{variant.key} from the numbers of {leader.variant.key}")
                known = dict(
                    zip(_paths(leader.variant), leader.point.theta[self.grey.shared :], strict=True)
                )
                extra = [known.get(path, 0.0) for path in _paths(variant)]
                theta = np.r_[leader.point.theta[: self.grey.shared], extra]
                if (
                    found := self.estimator.likeliest(self.grey, variant, theta, leader.noise)
                ) is not None:
                    fewer.append(found)
            self._keep(fewer)
            best = min(fewer, key=self._criterion, default=leader)
            if self._criterion(best) > self._criterion(leader):
                break
            leader = self.finals[best.variant.key]
        return leader

    def _on_all_samples(self) -> Fitted:
        """What stands on stretches, refitted on everything; the leader there."""
        self.grey = self.whole
        ranked = sorted(self.finals.values(), key=self._criterion)
        least = self._criterion(ranked[0])
        most, beyond = int(threshold("contenders")), least + threshold("beyond")
        near = [f for f in ranked if self._criterion(f) < beyond][:most]
        base = self.finals["nothing"]
        found = []
        for f in near:
            if self.grey.counter.stop():
                break
            self.tell(f"{f.variant.key} on all samples")
            again = self.estimator.likeliest(self.grey, f.variant, f.point.theta, f.noise)
            if again is not None:
                found.append(again)
        if not any(f.variant.key == base.variant.key for f in found):
            self._replayed_on_all_samples(base)
        else:
            self.finals.clear()
        self._keep(found)
        return min(self.finals.values(), key=self._criterion)

    def _leaves_noise(self, f: Fitted) -> bool:
        if f not in self.noisy:
            self.noisy[f] = leaves_noise(self.core, self.grey, f)
        return self.noisy[f]

    def _joints(self, leader: Fitted) -> list[Fitted]:
        """Joints that give, beside a machine whose numbers alone leave noise.

        On stretches such numbers and drifting zeros do as well as a soft shaft; only long records
        tell them apart.
        """
        found = []
        point, grey = leader.point, self.grey
        columns = grey.columns(point, range(len(point.theta)), leader.gains)
        for variant in self.library.variants(leader.variant, self._everywhere(leader)):
            if not is_joint(variant) or grey.counter.stop():
                continue
            if not part_score(grey, point, columns, variant, leader.noise) > threshold("hopeless"):
                continue
            self.tell(f"{variant.key} on all samples")
            begin = np.r_[leader.point.theta, [p.start for p in variant.extra]]
            own = self.estimator.likeliest(self.grey, variant, begin, leader.noise)
            if own is None:
                continue
            gain = (leader.point.minus_two_log - own.point.minus_two_log) / leader.inflation
            if gain > threshold("gain") + len(variant.extra) * self._price():
                self.tried[variant.key] = gain
                found.append(own)
        return found

    def _replayed_on_all_samples(self, base: Fitted) -> None:
        """Of a search that was stopped on stretches: the base alone, as it was found there."""
        self.grey = self.whole
        self.finals = {base.variant.key: on_all_samples(self.whole, base)}

    def _keep(self, found: Sequence[Fitted]) -> None:
        for f in found:
            known = self.finals.get(f.variant.key)
            if known is None or f.point.minus_two_log < known.point.minus_two_log:
                self.finals[f.variant.key] = f

    def _without(self, richer: Fitted, variant: Variant) -> Fitted | None:
        """A simpler variant, from the numbers and the noise found with more effects.

        What is gained by an effect is told against the simpler machine at its own best, which a
        search from the data sheet may have missed.
        """
        self.tell(f"{variant.key} from the numbers of {richer.variant.key}")
        theta = richer.point.theta[: self.grey.shared + len(variant.extra)]
        return self.estimator.likeliest(self.grey, variant, theta, richer.noise)

    def _criterion(self, f: Fitted) -> float:
        """Under the inflation of the best, lest a bad model's colour speaks for it."""
        numbers = len(f.variant.extra) * self._price() + 2.0 * np.log(f.variant.looks)
        return float(f.point.minus_two_log / self._least() + numbers)

    def _least(self) -> float:
        return min((g.inflation for g in self.finals.values()), default=1.0)

    def _price(self) -> float:
        """Of a number: that of the Bayesian criterion, and a share of all that is explained."""
        known = [g.point.minus_two_log for g in self.finals.values()]
        nothing = self.finals["nothing"].point.minus_two_log if known else 0.0
        explained = max(0.0, nothing - min(known, default=0.0))
        share = threshold("price of a number") * explained / self._least()
        return float(np.log(self.grey.samples) + share)

    def _weigh_drifting_zeros(self) -> None:
        """What the best machine leaves, explained by zeros that drift over times of their own.

        From a fraction of a second (1/f noise) to minutes. A rival of the laws like any other, and
        the last one: eccentric rings and encoders would pass for it while no law is in.
        """
        best = min(self.finals.values(), key=self._criterion)
        base = self.finals["nothing"]
        if self.grey.counter.stop() or white(best):
            return
        self.tell(f"drifting zeros beside {best.variant.key}")
        own = self.estimator.drifting(self.grey, best)
        self._keep([own])
        if best is not base:
            alone = self.estimator.drifting(self.grey, base)
            if self._criterion(alone) < self._criterion(own):
                self._keep([alone])

    def _step(
        self, leader: Fitted, scored: tuple[list[Scored], list[Array]], parts: bool
    ) -> list[Fitted]:
        """Every law beside the leader: the best scores refitted, and their noise estimated.

        Parts, too, if asked for, where no law leaves noise: whatever their scores, since these say
        little of what they do at their size.
        """
        scores, columns = scored
        best = worth_refitting(scores, self.effort.refitted)
        found = self._refitted(leader, best, columns)
        if parts and not any(map(self._leaves_noise, found)):
            rest = [s for s in scores if is_part(s.variant) and s not in best]
            found += self._refitted(leader, rest, columns)
        return found

    def _refitted(
        self, leader: Fitted, chosen: Sequence[Scored], columns: Sequence[Array]
    ) -> list[Fitted]:
        """Laws refitted under the leader's noise, and what is left of them under their own."""
        grey = self.grey
        noise, point, gains = leader.noise, leader.point, leader.gains
        over = inflation(point)
        refits: list[Point] = []
        for k, s in enumerate(chosen, 1):
            if grey.counter.stop():
                break
            self.tell(f"refitting {s.variant.key} ({k} of {len(chosen)})")
            own = refitted(self.estimator, grey, leader, s, columns)
            if not own.lost:
                refits.append(own)
                gain = point.minus_two_log - own.minus_two_log
                self.leader.meets(own.variant.key, own.minus_two_log, f"gain {gain / over:.3g}")
        if not refits:
            return []
        # what the best of them leaves is nearest to noise: its colour weighs the gains of all; and
        # what the leader itself would gain by as many steps is no law's
        over = min([over, *map(inflation, refits)])
        known = grey.shared
        again = fit(
            grey, point.variant, point.theta, gains, steps=5, shared_columns=columns[:known]
        )
        least = min(point.minus_two_log, again.minus_two_log)
        gains_of = {p.variant.key: (least - p.minus_two_log) / over for p in refits}
        self.tried.update(gains_of)
        looked = [(gains_of[p.variant.key] - 2.0 * np.log(p.variant.looks), p) for p in refits]
        looked.sort(key=lambda x: -x[0])
        enough = max(threshold("gain"), threshold("early") * self._price())
        best = with_rivals([p for gain, p in looked if gain > enough], self.effort.finals)
        return self._compared(best, noise)

    def _scores(self, leader: Fitted) -> tuple[list[Scored], list[Array]]:
        """Score tests of every law beside the leader, and the derivatives they stand on."""
        grey, point, gains = self.grey, leader.point, leader.gains
        columns = grey.columns(point, range(len(point.theta)), gains)
        variants = self.library.variants(leader.variant, self._everywhere(leader))
        beside = leader.variant.label
        self.tell(f"{len(variants)} laws beside {beside}")
        found = scores(
            grey, point, columns, variants, gains, inflation(point),
            lambda done, of: self.tell(f"score tests beside {beside}: {done} of {of}"),
        )  # fmt: skip
        self.screened += [(beside, s) for s in found]
        return found, columns

    def _everywhere(self, f: Fitted) -> Point:
        """Its innovations on all samples: orders show over long ways only."""
        return f.point if self.grey is self.whole else on_all_samples(self.whole, f).point

    def _compared(self, points: Sequence[Point], noise: Noise) -> list[Fitted]:
        """Laws, each under the noise that it leaves itself.

        From the leader's noise, since no law, of size nought at first, can come out less likely
        than it; and on under less torque of unknown course, which had stood for what the law does.
        Once one leaves noise, the others are fitted under that: what is far from it there does not
        come near by more unknown torque.
        """
        near = []
        for k, point in enumerate(points, 1):
            if self.grey.counter.stop():
                break
            self.tell(f"{point.variant.key} under less unknown torque ({k} of {len(points)})")
            if own := self.estimator.approach(self.grey, point.variant, point.theta, noise):
                near.append(own)
        near.sort(key=lambda f: f[0].minus_two_log)
        found, settled = list[Fitted](), None
        for point, noise in near:
            if self.grey.counter.stop():
                break
            self.tell(f"the noise beside {point.variant.key}")
            own = self.estimator.under(self.grey, point, settled.noise) if settled else None
            if settled is None or own is None or _near(own, settled):
                lead = min((f.point.minus_two_log for f in found), default=-np.inf)
                own = self.estimator.likeliest(
                    self.grey, point.variant, point.theta, noise, rival=lead
                )
            if own is None:
                continue
            found.append(own)
            if settled is None and self._leaves_noise(own):
                settled = own
        return found


def _paths(variant: Variant) -> list[str]:
    return [p.path for p in variant.extra]


def _near(f: Fitted, leader: Fitted) -> bool:
    """Whether it may come out as likely as the leader, under a noise of its own."""
    behind = f.point.minus_two_log - leader.point.minus_two_log
    return behind < threshold("beyond") * leader.inflation
