"""Forward selection of laws by likelihood, the noise estimated beside every leader.

A torque of unknown course bears what a model lacks: estimated by likelihood it is large where a
law is missing and small once the right one is in. A refit begins with much of it (any machine
follows the record then) and ends with the least that the records allow, where all of their
information counts
(Kristensen, Madsen, Jørgensen, Computers & Chemical Engineering 28 (2004) 1431-1449).

Long records are searched on stretches of them. What stands there is held against all samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.laws import clips
from dualdrive.diagnose.screening import Scored, is_part
from dualdrive.diagnose.selection.base import Base, refitted_base
from dualdrive.diagnose.selection.drift import weigh_drifting_zeros
from dualdrive.diagnose.selection.estimation import on_all_samples
from dualdrive.diagnose.selection.fitted import EFFORTS, Effort, Fitted, Selection
from dualdrive.diagnose.selection.forward import Forward, Means
from dualdrive.diagnose.selection.parts import brings, is_joint, part_score
from dualdrive.diagnose.selection.residual_analysis import suffices, white
from dualdrive.diagnose.selection.sandwich import forget_what_colour_gains
from dualdrive.diagnose.simulated_errors import Simulation, noise_floor
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, slopes, some

Array = NDArray[np.float64]


def select(
    core: Any,
    grey: GreyBox,
    effort: Effort = EFFORTS["normal"],
    tell: Callable[[str], None] = lambda _: None,
) -> Selection:
    """Search the library; see the module."""
    own = Means(core, grey, effort, tell)
    own.tell("refitting the data sheet's numbers")
    return _Search(own, refitted_base(own.estimator, grey)).run()


class _Search:
    """On stretches first, then on all samples.

    on: what is known on the present records
    """

    def __init__(self, own: Means, base: Base) -> None:
        self.own, self.base = own, base
        self.on = Forward(own, base.grey, [base.there])
        self._stretches: list[GreyBox] = []
        self._quiet = self._faint = False  # numbers alone leave noise: on all samples; on stretches
        self._simulated: Fitted | None = None  # likelier without any torque of unknown course

    def run(self) -> Selection:
        """See the module."""
        own, base = self.own, self.base
        # A torque of unknown course, however little, grows till innovations are white, and of what
        # it stands in for a score beside it says little: of the damping of a mesh that bounces a
        # hundredth of what it gains.
        if base.everywhere is not None and self.on.contest.lacks_nothing(base.there):
            self._on_all_samples_at_once(base.everywhere)
        else:
            self._forward(base.there)
            if base.grey is not own.whole and not self._simulated:
                deceptive = self.on.contest.leaves_noise(self.on.ranking.best)
                self._on_all_samples(base)
                if deceptive and not self.on.contest.leaves_noise(self.on.ranking.best):
                    self._simulated = self.on.without_unknown_torque(self.on.ranking.best)
                    if not self._simulated:
                        self._search_where_it_fails()
                # what all samples need no longer
                if not self._simulated:
                    self.on.backward.eliminated(self.on.ranking.best)
        if self._simulated:
            self._keep_simulated(self._simulated)
        else:
            self.on.backward.narrowed(self.on.ranking.best)
            self.on.forget_faint()
            weigh_drifting_zeros(own, self.on, self._stretches)
            forget_what_colour_gains(own, self.on.ranking, self.on.grey)
        ranking = self.on.ranking
        fits = (replace(f, criterion=ranking.criterion(f)) for f in ranking)
        every = sorted(fits, key=lambda f: f.criterion)
        order = sorted(own.screened, key=lambda s: -np.nan_to_num(s[1].gain, nan=-np.inf))
        nothing = next(f for f in every if f.variant.key == base.there.variant.key)
        finished = not own.whole.counter.stop()
        return Selection(own.whole, nothing, every, order, own.tried, finished, self._quiet)

    def _forward(self, leader: Fitted, most: int | None = None) -> None:
        self.on.selected(leader, most)
        self._simulated = self.on.simulated or self._simulated

    def _says_all(self, f: Fitted) -> bool:
        """Whether a machine leaves noise, and does so where no sample corrects it, too.

        A filter forgives what acts slowly: friction that changes with the angle is hardly a torque
        from sample to sample, and carries a simulation away.
        """
        whole = self.own.whole
        if not (white(f) and suffices(self.own.core, whole, f)):
            return False
        loop = Simulation.of(whole, f)
        out = loop.unfollowed(f.noise)
        left, floor = loop.creeping(f.noise).error(out), noise_floor(whole, f, out)
        return left < threshold("beyond the floor") * floor

    def _on_all_samples_at_once(self, everywhere: Fitted) -> None:
        """Laws beside numbers that leave noise on stretches: all samples are needed to see them.

        Parts are tried whatever is found, since a law that describes a little of what bristles do
        is likelier than none; joints where a law is that comes with them, before a second one, on
        stretches first, since each takes many replays.
        """
        whole, base = self.own.whole, self.base
        self._faint, self._quiet = True, self._says_all(everywhere)
        self.on = Forward(self.own, whole, [everywhere], base.grey, faint=True)
        self._forward(everywhere, most=1)
        if self._simulated:
            return
        parts = self._listed(everywhere)
        joints = self._joints(self.on.leader(), [s for s in parts if is_joint(s.variant)])
        others = [s for s in parts if not is_joint(s.variant)]
        self.on.ranking.keep(self._other_parts(everywhere, others))
        if joints:
            known = list(self.on.ranking)
            self.on = Forward(self.own, base.grey, [base.there, *joints], faint=True)
            if base.grey is not whole:
                self._on_all_samples(base)
            self.on.ranking.keep(known)
        if self.on.leader().variant.effects:
            self._forward(self.on.leader())
        self.on.backward.eliminated(self.on.ranking.best)

    def _joints(self, leader: Fitted, joints: Sequence[Scored]) -> list[Fitted]:
        """Joints beside numbers that leave noise, on stretches, as far as a leader leaves room.

        What a soft shaft does such numbers do nearly as well: it need not gain there.
        """
        there, grey = self.base.there, self.base.grey
        if leader.variant.effects:
            joints = [s for s in joints if brings(s.variant, leader.variant)]
        if not joints or self.own.whole.counter.stop():
            return []
        columns = slopes(grey, there.point, range(len(there.point.theta)), there.gains)
        return Forward(self.own, grey, [there]).contest.refitted(there, joints, columns, least=0.0)

    def _other_parts(self, everywhere: Fitted, others: Sequence[Scored]) -> list[Fitted]:
        """Other parts beside numbers that leave noise, on all samples."""
        others = self._worth_all_samples(others)
        if not others or self.own.whole.counter.stop():
            return []
        point = everywhere.point
        columns = slopes(self.own.whole, point, range(len(point.theta)), everywhere.gains)
        return self.on.contest.refitted(everywhere, others, columns, threshold("gain"))

    def _worth_all_samples(self, parts: Sequence[Scored]) -> list[Scored]:
        """Parts that are not hopeless on stretches, as of other laws.

        And limits: one may be met in a few samples only, which are on no stretch.
        """
        there, grey = self.base.there, self.base.grey
        if grey is self.own.whole:
            return list(parts)
        columns = slopes(grey, there.point, range(len(there.point.theta)), there.gains)
        kept = list[Scored]()
        for s in parts:
            if grey.counter.stop():
                break
            self.own.tell(f"score test of {s.variant.key}")
            if clips(s.variant.effects[-1][0]) or part_score(
                grey, there.point, columns, s.variant, there.noise
            ).gain > threshold("hopeless"):
                kept.append(s)
        return kept

    def _listed(self, beside: Fitted) -> list[Scored]:
        """Parts that a machine may lack, not scored yet."""
        variants = self.own.library.variants(beside.variant, self.on.ranking.base.point)
        return [Scored(v, float("nan"), {}) for v in variants if is_part(v)]

    def _keep_simulated(self, found: Fitted) -> None:
        """It beside the numbers alone, and what else is known on all samples."""
        ranking, whole = self.on.ranking, self.own.whole
        known = list(ranking) if self.on.grey is whole else []
        nothing = self.base.everywhere or self._everywhere_refitted(ranking.base, beaten=True)
        self.on = Forward(self.own, whole, [nothing, found, *known], faint=self._faint)

    def _on_all_samples(self, base: Base) -> None:
        """What stands on stretches, refitted on everything."""
        grey, ranking = self.on.grey, self.on.ranking
        near = list[Fitted]()
        if not self.own.whole.counter.stop():
            ranked = sorted(ranking, key=ranking.criterion)
            beyond = ranking.criterion(ranked[0]) + threshold("beyond")
            laws = [f for f in ranked if f.variant.effects and ranking.criterion(f) < beyond]
            near = laws[: int(threshold("contenders"))]
        self._stretches = [grey]
        self.on = Forward(self.own, self.own.whole, [], grey, faint=self._faint)
        found = self.on.contest.on_these(near)
        nothing = base.everywhere or self._everywhere_refitted(ranking.base, bool(found))
        begun = {f.variant.key: f.point.theta for f in near}
        found = [self._no_less_likely(f, nothing, begun[f.variant.key]) for f in found]
        self.on.ranking.keep([nothing, *found])

    def _no_less_likely(self, f: Fitted, nothing: Fitted, begun: Array) -> Fitted:
        """A law on all samples, sought once more where it is less likely than the numbers alone."""
        whole = self.own.whole
        if f.point.minus_two_log < nothing.point.minus_two_log or whole.counter.stop():
            return f
        self.own.tell(f"{f.variant.key} under the noise of the numbers alone")
        return self.own.estimator.beside_nested(whole, f, nothing, begun)

    def _search_where_it_fails(self) -> None:
        """Beside the best machine that leaves noise on stretches, on others, where it fails.

        What passed for the law that is missing is taken out again once that one stands beside it.
        """
        on, whole, estimator = self.on, self.own.whole, self.own.estimator
        nothing, best = on.ranking.base, on.ranking.best
        self.own.tell(f"stretches where {best.variant.key} fails")
        grey = some(whole, best.point, best.gains, int(threshold("stretches")))
        there = [
            estimator.likeliest(grey, f.variant, f.point.theta, f.noise) for f in (nothing, best)
        ]
        found = [f for f in there if f is not None]
        if len(found) < len(there):
            return
        self.on = Forward(self.own, grey, found, faint=self._faint)
        self._forward(found[-1])
        if self.on.ranking.best.variant.key == best.variant.key:  # nothing describes what is left
            self.on = on
            return
        self._on_all_samples(Base(grey, found[0], nothing))
        self.on.ranking.keep(on.ranking)

    def _everywhere_refitted(self, base: Fitted, beaten: bool) -> Fitted:
        """The numbers alone on all samples; to the end where no law stands."""
        whole, estimator = self.own.whole, self.own.estimator
        self.own.tell("nothing on all samples")
        if whole.counter.stop():
            return on_all_samples(whole, base)
        if beaten:
            found = estimator.under(whole, base.variant, [base.point.theta], base.noise)
        else:
            found = estimator.likeliest(whole, base.variant, base.point.theta, base.noise)
        return found or on_all_samples(whole, base)
