"""Forward selection of laws by likelihood, the noise estimated beside every leader.

A torque of unknown course bears what a model lacks: estimated by likelihood it is large where a
law is missing and small once the right one is in. A refit begins with much of it (any machine
follows the record then) and ends with the least that the records allow, where all of their
information counts
(Kristensen, Madsen, Jørgensen, Computers & Chemical Engineering 28 (2004) 1431-1449).

Long records are searched on stretches of them. What stands there is held against all samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.screening import Library, Scored, scores
from dualdrive.diagnose.selection.base import Base, refitted_base
from dualdrive.diagnose.selection.contest import Contest
from dualdrive.diagnose.selection.elimination import Elimination
from dualdrive.diagnose.selection.estimation import Estimator, on_all_samples
from dualdrive.diagnose.selection.fitted import EFFORTS, Effort, Fitted, Selection
from dualdrive.diagnose.selection.output_error import opens, without_unknown_torque
from dualdrive.diagnose.selection.parts import brings, is_joint, is_part
from dualdrive.diagnose.selection.ranking import Ranking
from dualdrive.diagnose.selection.refits import worth_refitting
from dualdrive.diagnose.selection.residual_analysis import suffices, white
from dualdrive.diagnose.simulated_errors import Simulation, noise_floor
from dualdrive.diagnose.work import Leader
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, Point, Variant, inflation, some

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
        self.tried: dict[str, float] = {}  # see `Contest`
        self.estimator = Estimator(core, grey)
        self.stretches: list[tuple[GreyBox, Fitted, Fitted]] = []  # searched; base and best there
        self._quiet = self._faint = False  # numbers alone leave noise: on all samples; on stretches
        self._simulated: Fitted | None = None  # likelier without any torque of unknown course

    def tell(self, what: str) -> None:
        """Say what is tried, and what is best so far."""
        self.told(self.leader.after(what))

    def run(self) -> Selection:
        self.tell("refitting the data sheet's numbers")
        base = refitted_base(self.estimator, self.whole)
        self._compare_on(base.grey, [base.there])
        if base.everywhere is not None and self.contest.leaves_noise(base.there):
            self._on_all_samples_at_once(base, base.everywhere)
        else:
            self._forward(base.there)
            if base.grey is not self.whole and not self._simulated:
                deceptive = self.contest.leaves_noise(self.ranking.best)
                self._on_all_samples(base)
                if deceptive and not self.contest.leaves_noise(self.ranking.best):
                    self._search_where_it_fails(base)
                self.backward.eliminated(self.ranking.best)  # what all samples need no longer
        if self._simulated:
            self._keep_simulated(base, self._simulated)
        else:
            self.backward.narrowed(self.ranking.best)
            self._forget_faint()
            self._weigh_drifting_zeros()
        own = (replace(f, criterion=self.ranking.criterion(f)) for f in self.ranking)
        every = sorted(own, key=lambda f: f.criterion)
        order = sorted(self.screened, key=lambda s: -np.nan_to_num(s[1].gain, nan=-np.inf))
        nothing = next(f for f in every if f.variant.key == base.there.variant.key)
        finished = not self.whole.counter.stop()
        return Selection(self.whole, nothing, every, order, self.tried, finished, self._quiet)

    def _says_all(self, f: Fitted) -> bool:
        """Whether a machine leaves noise, and does so where no sample corrects it, too.

        A filter forgives what acts slowly: friction that changes with the angle is hardly a torque
        from sample to sample, and carries a simulation away.
        """
        if not (white(f) and suffices(self.core, self.whole, f)):
            return False
        loop = Simulation.of(self.whole, f)
        out = loop.unfollowed(f.noise)
        left, floor = loop.error(out), noise_floor(self.whole, f, out)
        return left < threshold("beyond the floor") * floor

    def _compare_on(
        self, grey: GreyBox, found: Sequence[Fitted], few: GreyBox | None = None
    ) -> None:
        """On these records from now on, this being known there.

        few: stretches of them, on which it is looked first
        """
        self.grey, self.ranking = grey, Ranking(grey.samples, found)
        self.few = few if few is not grey else None
        self.contest = Contest(
            self.estimator, grey, self.effort, self.leader, self.tell, self.tried
        )
        self.backward = Elimination(
            self.estimator, self.library, grey, self.ranking, self.tell, self.few
        )

    def _on_all_samples_at_once(self, base: Base, everywhere: Fitted) -> None:
        """Laws beside numbers that leave noise on stretches: all samples are needed to see them.

        Parts are tried where none is found, and joints where one is that comes with them, before a
        second law; on stretches first, since each takes many replays.
        """
        self._faint, self._quiet = True, self._says_all(everywhere)
        self._compare_on(self.whole, [everywhere], base.grey)
        self._forward(everywhere, most=1)
        if self._simulated:
            return
        leader = self._leader()
        parts = self._parts(base, leader)
        if parts:
            known = list(self.ranking)
            self._compare_on(base.grey, [base.there, *parts])
            if base.grey is not self.whole:
                self._on_all_samples(base)
            self.ranking.keep(known)
        if self._leader().variant.effects:
            self._forward(self._leader())
        self.backward.eliminated(self.ranking.best)

    def _leader(self) -> Fitted:
        """The best of all, where it gains enough beside numbers that leave noise; else these."""
        nothing, best = self.ranking.base, self.ranking.best
        gained = self.ranking.criterion(nothing) - self.ranking.criterion(best)
        return best if gained > threshold("gain") else nothing

    def _parts(self, base: Base, leader: Fitted) -> list[Fitted]:
        """Parts beside numbers that leave noise on stretches, as far as a leader leaves room.

        What a soft shaft does such numbers do nearly as well: it need not gain there.
        """
        there, grey = base.there, base.grey
        variants = self.library.variants(there.variant, self.ranking.base.point)
        parts = [Scored(v, float("nan"), {}) for v in variants if is_part(v)]
        if leader.variant.effects:
            parts = [s for s in parts if brings(s.variant, leader.variant)]
        if not parts or self.whole.counter.stop():
            return []
        columns = grey.columns(there.point, range(len(there.point.theta)), there.gains)
        joints = [s for s in parts if is_joint(s.variant)]
        others = [s for s in parts if s not in joints]
        contest = Contest(self.estimator, grey, self.effort, self.leader, self.tell, self.tried)
        found = contest.refitted(there, joints, columns, least=0.0)
        return found + contest.refitted(there, others, columns, threshold("gain"))

    def _forward(self, leader: Fitted, most: int | None = None) -> None:
        """Law by law, while they bring enough and what is left is no noise.

        Where hardly anything is missing, scores alone say whether a law is: their test is far
        sharper than that of the residuals as a whole.

        Args:
            leader: beside which the first is sought.
            most: laws in all; as many as the effort allows unless given.

        """
        for count in range((most or self.effort.most) - len(leader.variant.effects)):
            named = bool(leader.variant.effects)
            done = named and not self._faint and self.contest.leaves_noise(leader)
            if self.grey.counter.stop() or done:
                break
            parts = count == 0 and not self._faint
            sheet = None if named or self._faint else self._beside_the_data_sheet()
            found = self._step(leader, self._scores(leader), parts, sheet)
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
            self.leader.judged(leader.variant.key, f"gain {gained:.3g}")
            self._simulated = self._without_unknown_torque(leader)
            if self._simulated:
                break
            if len(leader.variant.effects) == _PAIR and not self.contest.leaves_noise(leader):
                leader = self._swapped(leader)

    def _without_unknown_torque(self, leader: Fitted) -> Fitted | None:
        """A joint that opens, by its simulation, if that is likelier than any filter of it."""
        if not opens(leader.variant) or self.contest.suffices(leader):
            return None
        self.tell(f"simulating {leader.variant.key}")
        return without_unknown_torque(self.estimator, self.whole, leader)

    def _keep_simulated(self, base: Base, own: Fitted) -> None:
        """It beside the numbers alone, and what else is known on all samples."""
        known = list(self.ranking) if self.grey is self.whole else []
        nothing = base.everywhere or self._everywhere_refitted(self.ranking.base, beaten=True)
        self._compare_on(self.whole, [nothing, own, *known])

    def _beside_the_data_sheet(self) -> dict[str, Scored]:
        """Key -> score of every law beside the data sheet's numbers, under much unknown torque.

        Numbers that stand in for a law hide it from its score, and may turn that score's sign.
        """
        sheet = self.estimator.of_the_data_sheet(self.grey)
        if sheet is None:
            return {}
        scores, _ = self._scores(sheet)
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
        return self._step(second, self._scores(second), parts=False)

    def _swapped(self, leader: Fitted) -> Fitted:
        """What came before the last effect taken out again, and others tried in its place."""
        for effect in leader.variant.effects[:-1]:
            rest = self.library.without(leader.variant, effect)
            if rest is None or rest.key not in self.ranking or self.grey.counter.stop():
                continue
            fewer = self.ranking[rest.key]
            self.ranking.keep(self._step(fewer, self._scores(fewer), parts=False))
        best = self.ranking.best
        if self.ranking.criterion(leader) - self.ranking.criterion(best) < threshold("gain"):
            return leader
        self.leader.judged(best.variant.key, "instead")
        return self.backward.eliminated(best, proven=1)

    def _on_all_samples(self, base: Base) -> None:
        """What stands on stretches, refitted on everything."""
        near = list[Fitted]()
        if not self.whole.counter.stop():
            ranked = sorted(self.ranking, key=self.ranking.criterion)
            beyond = self.ranking.criterion(ranked[0]) + threshold("beyond")
            laws = [f for f in ranked if f.variant.effects and self.ranking.criterion(f) < beyond]
            near = laws[: int(threshold("contenders"))]
        there = self.ranking.base
        self.stretches = [(self.grey, there, self.ranking.best)]
        self._compare_on(self.whole, [], self.grey)
        found = self.contest.on_these(near)
        nothing = base.everywhere or self._everywhere_refitted(there, bool(found))
        self.ranking.keep([nothing, *found])

    def _search_where_it_fails(self, base: Base) -> None:
        """Once more, on stretches where the best machine fails that leaves noise on others."""
        known, nothing, best = list(self.ranking), self.ranking.base, self.ranking.best
        self.tell(f"stretches where {best.variant.key} fails")
        grey = some(self.whole, best.point, best.gains, int(threshold("stretches")))
        there = self.estimator.likeliest(
            grey, nothing.variant, base.there.point.theta, base.there.noise
        )
        if there is None:
            return
        self._compare_on(grey, [there])
        self._forward(there)
        self._on_all_samples(Base(grey, there, nothing))
        self.ranking.keep(known)

    def _everywhere_refitted(self, base: Fitted, beaten: bool) -> Fitted:
        """The numbers alone on all samples; to the end where no law stands."""
        self.tell("nothing on all samples")
        if self.whole.counter.stop():
            return on_all_samples(self.whole, base)
        if beaten:
            found = self.estimator.under(self.whole, base.variant, [base.point.theta], base.noise)
        else:
            found = self.estimator.anew(self.whole, base)
        return found or on_all_samples(self.whole, base)

    def _forget_faint(self) -> None:
        """Laws that gain too little to be told from the numbers, where these alone leave noise.

        Joints that give always: such numbers do nearly as well.
        """
        enough = self.ranking.criterion(self.ranking.base) - threshold("gain")
        for f in list(self.ranking):
            told = not self._faint and not is_joint(f.variant)
            if f.variant.effects and not told and self.ranking.criterion(f) > enough:
                self.ranking.forget(f)

    def _weigh_drifting_zeros(self) -> None:
        """What the best machine leaves, explained by zeros that drift over times of their own.

        From a fraction of a second (1/f noise) to minutes. A rival of the laws like any other, and
        the last one: eccentric rings and encoders would pass for it while no law is in.
        """
        best, base = self.ranking.best, self.ranking.base
        if self.grey.counter.stop() or white(best):
            return
        alone = base
        places = [*self.stretches, (self.grey, base, best)] if best is not base else []
        for grey, own, lead in places:
            self.tell("drifting zeros")
            alone = self.estimator.drifting(grey, own, rival=lead.point.minus_two_log)
            behind = alone.point.minus_two_log > lead.point.minus_two_log
            if behind and best.inflation < threshold("inflation"):
                return
        self.tell(f"drifting zeros beside {best.variant.key}")
        own = self.estimator.drifting(self.grey, best)
        self.ranking.keep([own])
        if self.ranking.criterion(alone) < self.ranking.criterion(own):
            self.ranking.keep([alone])

    def _step(
        self,
        leader: Fitted,
        scored: tuple[list[Scored], list[Array]],
        parts: bool,
        sheet: Mapping[str, Scored] | None = None,
    ) -> list[Fitted]:
        """Every law beside the leader: the best scores refitted, and their noise estimated.

        The best beside the data sheet's numbers (key -> score), too, where those are given.
        Parts, too, if asked for, where no law leaves noise, and joints where one does that comes
        with them: whatever their scores, since these say little of what they do at their size.
        """
        scores, columns = scored
        contest = self.contest
        least = max(threshold("gain"), threshold("early") * self.ranking.price())
        known = leader.variant.effects and contest.suffices(leader)
        hopeless = threshold("hopeless beside a law" if known else "hopeless")
        if self._faint:  # what is small is told by its score, and what it is taken for as well
            most = max((s.gain for s in scores if np.isfinite(s.gain)), default=0.0)
            hopeless = max(threshold("gain"), threshold("runner-up") * most)
        best = worth_refitting(scores, self.effort.refitted, hopeless)
        others = {s.variant.key: s for s in scores if s not in best}
        far = worth_refitting(list((sheet or {}).values()), self.effort.finals, hopeless)
        best += [others[s.variant.key] for s in far if s.variant.key in others]

        def more(found: Sequence[Fitted]) -> list[Scored]:
            rest = [s for s in scores if parts and is_part(s.variant) and s not in best]
            noise = [f for f in found if contest.leaves_noise(f)]
            if noise:
                rest = [s for s in rest if any(brings(s.variant, f.variant) for f in noise)]
            return rest

        return contest.refitted(leader, best, columns, least, more, sheet)

    def _scores(self, leader: Fitted) -> tuple[list[Scored], list[Array]]:
        """Score tests of every law beside the leader, and the derivatives they stand on.

        On all samples a test costs many times what it does on stretches: there only of those laws
        that are not hopeless on these already.
        """
        variants = self.library.variants(leader.variant, self._everywhere(leader))
        if self.few:
            [there] = self.few.likelihoods(leader.variant, [(leader.point.theta, leader.noise)])
            if there is not None:
                found, _ = self._scored(self.few, *there, variants)
                variants = [s.variant for s in found if not s.gain < threshold("hopeless")]
        found, columns = self._scored(self.grey, leader.point, leader.gains, variants)
        self.screened += [(leader.variant.label, s) for s in found]
        return found, columns

    def _scored(
        self, grey: GreyBox, point: Point, gains: Sequence[Any], variants: Sequence[Variant]
    ) -> tuple[list[Scored], list[Array]]:
        """Score tests of laws beside a leader at a point of its own on some records."""
        beside = point.variant.label
        self.tell(f"{len(variants)} laws beside {beside}")
        columns = grey.columns(point, range(len(point.theta)), gains)
        found = scores(
            grey, point, columns, variants, gains, inflation(point),
            lambda done, of: self.tell(f"score tests beside {beside}: {done} of {of}"),
        )  # fmt: skip
        return found, columns

    def _everywhere(self, f: Fitted) -> Point:
        """Its innovations on all samples: orders show over long ways only."""
        return f.point if self.grey is self.whole else on_all_samples(self.whole, f).point
