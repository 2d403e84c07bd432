"""Laws beside a leader against each other: under its noise first, then under their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.screening import Scored
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Effort, Fitted
from dualdrive.diagnose.selection.refits import refitted, with_rivals
from dualdrive.diagnose.selection.residual_analysis import suffices, white
from dualdrive.diagnose.thresholds import threshold
from dualdrive.diagnose.work import Leader
from dualdrive.innovations import GreyBox, Noise, Point, fit, inflation

Array = NDArray[np.float64]


class Contest:
    """Compares laws on records.

    Attributes:
        estimator: of the machine.
        grey: the records.
        effort: how much is tried.
        leader: who leads so far.
        tell: progress.
        tried: label -> gain of laws refitted under a leader's noise, over the inflation; filled.

    """

    def __init__(
        self,
        estimator: Estimator,
        grey: GreyBox,
        effort: Effort,
        leader: Leader,
        tell: Callable[[str], None],
        tried: dict[str, float],
    ) -> None:
        self.estimator, self.grey, self.effort = estimator, grey, effort
        self.leader, self.tell, self.tried = leader, tell, tried
        self._suffices: dict[Fitted, bool] = {}

    def suffices(self, f: Fitted) -> bool:
        """Whether it asks for hardly any torque of unknown course; see `residual_analysis`."""
        if f not in self._suffices:
            self._suffices[f] = suffices(self.estimator.core, self.grey, f)
        return self._suffices[f]

    def leaves_noise(self, f: Fitted) -> bool:
        """Whether what it leaves is noise: a law that is likelier still would describe that."""
        return white(f) and self.suffices(f)

    def refitted(
        self, leader: Fitted, chosen: Sequence[Scored], columns: Sequence[Array], least: float
    ) -> list[Fitted]:
        """Laws refitted under the leader's noise, and the best of them under their own.

        Args:
            leader: beside which they were scored.
            chosen: their scores.
            columns: derivatives of the leader's innovations by all its unknowns.
            least: gain over the inflation, from which the noise is estimated beside a law.

        """
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
        nothing = min(point.minus_two_log, again.minus_two_log)
        gains_of = {p.variant.key: (nothing - p.minus_two_log) / over for p in refits}
        self.tried.update(gains_of)
        looked = [(gains_of[p.variant.key] - 2.0 * np.log(p.variant.looks), p) for p in refits]
        looked.sort(key=lambda x: -x[0])
        best = with_rivals([p for gain, p in looked if gain > least], self.effort.finals)
        return self.compared([(p, noise) for p in best])

    def compared(self, starts: Sequence[tuple[Point, Noise]]) -> list[Fitted]:
        """Laws, each under the noise that it leaves itself.

        From the leader's noise, since no law, of size nought at first, can come out less likely
        than it; and on under less torque of unknown course, which had stood for what the law does.
        Once one suffices, the others are fitted under its noise: what is far from it there does not
        come near by more unknown torque.

        Args:
            starts: of every law, where it begins, and the noise with which.

        """
        near = []
        for k, (point, noise) in enumerate(starts, 1):
            if self.grey.counter.stop():
                break
            self.tell(f"{point.variant.key} under less unknown torque ({k} of {len(starts)})")
            if place := self.estimator.approach(self.grey, point.variant, point.theta, noise):
                near.append(place)
        near.sort(key=lambda f: f[0].minus_two_log)
        found = list[Fitted]()
        settled: Fitted | None = None
        for point, own_noise in near:
            if self.grey.counter.stop():
                break
            self.tell(f"the noise beside {point.variant.key}")
            if settled:
                there = self.estimator.under(self.grey, point.variant, point.theta, settled.noise)
                if there is not None and not _near(there, settled):
                    continue
            lead = min((f.point.minus_two_log for f in found), default=-np.inf)
            own = self.estimator.likeliest(
                self.grey, point.variant, point.theta, own_noise, rival=lead
            )
            if own is None:
                continue
            found.append(own)
            if settled is None and self.suffices(own):
                settled = own
        return found


def _near(f: Fitted, leader: Fitted) -> bool:
    """Whether it may come out as likely as the leader, under a noise of its own."""
    behind = f.point.minus_two_log - leader.point.minus_two_log
    return behind < threshold("beyond") * leader.inflation
