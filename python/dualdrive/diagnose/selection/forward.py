"""Forward selection of laws on one set of records.

(Draper, Smith, Applied Regression Analysis, 3rd ed., 15.) One law after the other, each the best of
all beside what stands, and swaps of those that came first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.loads import LOAD
from dualdrive.diagnose.screening import Library, Scored, is_part, loads, scores
from dualdrive.diagnose.selection.contest import Contest
from dualdrive.diagnose.selection.elimination import Elimination
from dualdrive.diagnose.selection.estimation import Estimator, on_all_samples
from dualdrive.diagnose.selection.fitted import Effort, Fitted
from dualdrive.diagnose.selection.output_error import opens, without_unknown_torque
from dualdrive.diagnose.selection.parts import is_joint, may_be_missing
from dualdrive.diagnose.selection.ranking import Ranking
from dualdrive.diagnose.selection.refits import worth_refitting
from dualdrive.diagnose.work import Leader
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, Point, Variant, inflation, slopes

Array = NDArray[np.float64]

_PAIR = 2  # effects, of which the first was chosen by what both leave together


class Means:
    """What a search has, whatever the records on which it compares.

    Attributes:
        core: the machine.
        whole: all samples of its records.
        effort: how much is tried.
        library: what may be missing.
        estimator: of the machine.
        leader: who leads so far.
        screened: every score test that was done: (beside what, score); filled.
        tried: key -> gain of laws refitted under a leader's noise, over the inflation; filled.

    """

    def __init__(
        self, core: Any, grey: GreyBox, effort: Effort, tell: Callable[[str], None]
    ) -> None:
        self.core, self.whole, self.effort, self._told = core, grey, effort, tell
        self.library, self.estimator = Library(core, grey), Estimator(core, grey)
        self.leader = Leader()
        self.screened: list[tuple[str, Scored]] = []
        self.tried: dict[str, float] = {}

    def tell(self, what: str) -> None:
        """Say what is tried, and what is best so far."""
        self._told(self.leader.after(what))


class Forward:
    """Laws compared on some records.

    Attributes:
        grey: the records.
        ranking: what is known on them.
        contest: compares laws on them.
        backward: takes effects out again.
        few: stretches of them, on which it is looked first; None: there are none.
        faint: whether numbers alone leave noise on stretches: what is small is told by its score.
        simulated: a law that is likelier without any torque of unknown course.

    """

    def __init__(
        self,
        own: Means,
        grey: GreyBox,
        found: Sequence[Fitted],
        few: GreyBox | None = None,
        *,
        faint: bool = False,
    ) -> None:
        self.own, self.grey, self.faint = own, grey, faint
        self.ranking = Ranking(grey.samples, found)
        self.few = few if few is not grey else None
        self.simulated: Fitted | None = None
        self.contest = Contest(
            own.estimator, own.library, grey, own.effort, own.leader, own.tell, own.tried
        )
        self.backward = Elimination(
            own.estimator, own.library, grey, self.ranking, own.tell, self.few
        )

    def leader(self) -> Fitted:
        """The best of all, where it gains enough beside numbers that leave noise; else these."""
        nothing, best = self.ranking.base, self.ranking.best
        gained = self.ranking.criterion(nothing) - self.ranking.criterion(best)
        return best if gained > threshold("gain") else nothing

    def selected(self, leader: Fitted, most: int | None = None) -> None:
        """Law by law, while they bring enough and what is left is no noise.

        Where hardly anything is missing, scores alone say whether a law is: their test is far
        sharper than that of the residuals as a whole.

        Args:
            leader: beside which the first is sought.
            most: laws in all; as many as the effort allows unless given.

        """
        for _ in range((most or self.own.effort.most) - len(leader.variant.effects)):
            named = bool(leader.variant.effects)
            done = named and not self.faint and self.contest.leaves_noise(leader)
            if self.grey.counter.stop() or done:
                break
            parts = not named and not self.faint
            sheet = None if named or self.faint else self._beside_the_data_sheet()
            found = self._step(leader, self.scores_beside(leader), parts, sheet)
            self.ranking.keep(found)
            if not any(map(self.contest.suffices, [*found, *([leader] if named else [])])):
                self.ranking.keep(self._beside_the_runner_up(leader))
            if found:
                richer = min(found, key=self.ranking.criterion)
                self.ranking.keep(self.backward.simpler(richer, leader))
                leader = self.ranking[leader.variant.key]
            best = self.ranking.best
            gained = self.ranking.criterion(leader) - self.ranking.criterion(best)
            if best is leader or gained < threshold("gain"):
                break
            leader = self.backward.eliminated(best, proven=1)
            self.own.leader.judged(leader.variant.key, f"gain {gained:.3g}")
            self.simulated = self.without_unknown_torque(leader)
            if self.simulated:
                break
            if len(leader.variant.effects) == _PAIR and not self.contest.leaves_noise(leader):
                leader = self._swapped(leader)

    def without_unknown_torque(self, leader: Fitted) -> Fitted | None:
        """A joint that opens, by its simulation, if that is likelier than any filter of it."""
        if not opens(leader.variant) or self.contest.leaves_noise(leader):
            return None
        self.own.tell(f"simulating {leader.variant.key}")
        return without_unknown_torque(self.own.estimator, self.own.whole, leader)

    def _beside_the_data_sheet(self) -> dict[str, Scored]:
        """Key -> score of every law beside the data sheet's numbers, under much unknown torque.

        Numbers that stand in for a law hide it from its score, and may turn that score's sign.
        """
        sheet = self.own.estimator.of_the_data_sheet(self.grey)
        if sheet is None:
            return {}
        scores, _ = self.scores_beside(sheet)
        return {s.variant.key: s for s in scores}

    def _beside_the_runner_up(self, leader: Fitted) -> list[Fitted]:
        """Pairs with the second-best law, where it is nearly as good alone as the leader.

        Of two laws that are both missing, what each takes of the other's share decides which leads.
        """
        singles = [f for f in self.ranking if len(f.variant.effects) == 1]
        if leader not in singles or self.grey.counter.stop():
            return []
        nothing = self.ranking.criterion(self.ranking.base)
        least = threshold("runner-up") * (nothing - self.ranking.criterion(leader))
        rivals = [
            f for f in singles if f is not leader and nothing - self.ranking.criterion(f) > least
        ]
        if not rivals:
            return []
        second = min(rivals, key=self.ranking.criterion)
        return self._step(second, self.scores_beside(second), parts=False)

    def _swapped(self, leader: Fitted) -> Fitted:
        """What came before the last effect taken out again, and others tried in its place."""
        for effect in leader.variant.effects[:-1]:
            rest = self.own.library.without(leader.variant, effect)
            if rest is None or rest.key not in self.ranking or self.grey.counter.stop():
                continue
            fewer = self.ranking[rest.key]
            self.ranking.keep(self._step(fewer, self.scores_beside(fewer), parts=False))
        best = self.ranking.best
        if self.ranking.criterion(leader) - self.ranking.criterion(best) < threshold("gain"):
            return leader
        self.own.leader.judged(best.variant.key, "instead")
        return self.backward.eliminated(best, proven=1)

    def _step(
        self,
        leader: Fitted,
        scored: tuple[list[Scored], list[Array]],
        parts: bool,
        sheet: Mapping[str, Scored] | None = None,
    ) -> list[Fitted]:
        """Every law beside the leader: the best scores refitted, and their noise estimated.

        The best beside the data sheet's numbers (key -> score), too, where those are given.
        Parts, too, if asked for, whatever their scores, since these say little of what they do at
        their size; of joints, where a law leaves noise, those alone that it comes with.
        """
        scores, columns = scored
        contest = self.contest
        least = max(threshold("gain"), threshold("early") * self.ranking.price())
        known = leader.variant.effects and contest.suffices(leader)
        hopeless = threshold("hopeless beside a law" if known else "hopeless")
        if self.faint:  # what is small is told by its score, and what it is taken for as well
            most = max((s.gain for s in scores if np.isfinite(s.gain)), default=0.0)
            hopeless = max(threshold("gain"), threshold("runner-up") * most)
        best = worth_refitting(scores, self.own.effort.refitted, hopeless)
        others = {s.variant.key: s for s in scores if s not in best}
        far = worth_refitting(list((sheet or {}).values()), self.own.effort.finals, hopeless, 1)
        best += [others[s.variant.key] for s in far if s.variant.key in others]

        def more(found: Sequence[Fitted]) -> list[Scored]:
            rest = [s for s in scores if parts and is_part(s.variant) and s not in best]
            quiet = [f.variant for f in found if contest.lacks_nothing(f)]
            return [s for s in rest if may_be_missing(s.variant, quiet)]

        return contest.refitted(leader, best, columns, least, more, sheet)

    def scores_beside(self, leader: Fitted) -> tuple[list[Scored], list[Array]]:
        """Score tests of every law beside the leader, and the derivatives they stand on.

        On all samples a test costs many times what it does on stretches: there only of those laws
        that are not hopeless on these already, and of a load in time, which they may lie beside.
        """
        all_of_it = self._everywhere(leader)
        in_time = loads(self.own.whole, all_of_it.point, all_of_it.gains, all_of_it.noise)
        variants = self.own.library.variants(leader.variant, all_of_it.point, in_time)
        if self.few:
            [there] = self.few.likelihoods(leader.variant, [(leader.point.theta, leader.noise)])
            if there is not None:
                found, _ = self._scored(self.few, *there, variants)
                variants = [
                    s.variant
                    for s in found
                    if not s.gain < threshold("hopeless") or s.variant.effects[-1] == LOAD
                ]
        found, columns = self._scored(self.grey, leader.point, leader.gains, variants)
        self.own.screened += [(leader.variant.label, s) for s in found]
        return found, columns

    def _scored(
        self, grey: GreyBox, point: Point, gains: Sequence[Any], variants: Sequence[Variant]
    ) -> tuple[list[Scored], list[Array]]:
        """Score tests of laws beside a leader at a point of its own on some records."""
        beside = point.variant.label
        self.own.tell(f"{len(variants)} laws beside {beside}")
        columns = slopes(grey, point, range(len(point.theta)), gains)
        found = scores(
            grey, point, columns, variants, gains, inflation(point),
            lambda done, of: self.own.tell(f"score tests beside {beside}: {done} of {of}"),
            faint=self.faint,
        )  # fmt: skip
        return found, columns

    def _everywhere(self, f: Fitted) -> Fitted:
        """On all samples: orders show over long ways only, and loads in time at their hour."""
        return f if self.grey is self.own.whole else on_all_samples(self.own.whole, f)

    def forget_faint(self) -> None:
        """Laws that gain too little to be told from the numbers, where these alone leave noise.

        Joints that give always: such numbers do nearly as well.
        """
        enough = self.ranking.criterion(self.ranking.base) - threshold("gain")
        for f in list(self.ranking):
            told = not self.faint and not is_joint(f.variant)
            if f.variant.effects and not told and self.ranking.criterion(f) > enough:
                self.ranking.forget(f)
