"""Laws beside a leader against each other: under its noise first, then under their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.screening import Library, Scored
from dualdrive.diagnose.selection.begins import begins_beside, in_its_place
from dualdrive.diagnose.selection.estimation import Estimator, on_all_samples
from dualdrive.diagnose.selection.fitted import Effort, Fitted
from dualdrive.diagnose.selection.parts import is_joint, part_score
from dualdrive.diagnose.selection.refits import confused, refining, refitted, with_rivals
from dualdrive.diagnose.selection.residual_analysis import needs_no_torque, suffices, white
from dualdrive.diagnose.work import Leader
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, Place, Point, fit, inflation, slopes, some

Array = NDArray[np.float64]

_Ranked = tuple[float, Place]  # gain under a leader's noise, and where a law came to


class Contest:
    """Compares laws on records.

    Attributes:
        estimator: of the machine.
        library: what variants are made of.
        grey: the records.
        effort: how much is tried.
        leader: who leads so far.
        tell: progress.
        tried: key -> gain of laws refitted under a leader's noise, over the inflation; filled.

    """

    def __init__(
        self,
        estimator: Estimator,
        library: Library,
        grey: GreyBox,
        effort: Effort,
        leader: Leader,
        tell: Callable[[str], None],
        tried: dict[str, float],
    ) -> None:
        self.estimator, self.library = estimator, library
        self.grey, self.effort = grey, effort
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

    def lacks_nothing(self, f: Fitted) -> bool:
        """Whether it leaves noise and needs no torque of unknown course, however little of it."""
        return self.leaves_noise(f) and needs_no_torque(self.estimator.core, self.grey, f)

    def refitted(
        self,
        leader: Fitted,
        chosen: Sequence[Scored],
        columns: Sequence[Array],
        least: float,
        parts: Callable[[Sequence[Fitted]], Sequence[Scored]] = lambda _: (),
        sheet: Mapping[str, Scored] | None = None,
    ) -> list[Fitted]:
        """Laws refitted under the leader's noise, and the best of them under their own.

        First those that are nearly as good as the best, with what the library declares them to be
        taken for, which may have come less near. What one of them leaves may be noise; the others
        need not come near then.

        Args:
            leader: beside which they were scored.
            chosen: their scores.
            columns: derivatives of the leader's innovations by all its unknowns.
            least: gain over the inflation, from which the noise is estimated beside a law.
            parts: which parts are refitted, too, where the first have left this; before the other
                laws, since a part that is missing leaves room to many that do not describe it.
                Where a law suffices, those that are no joints may only refine it.
            sheet: key -> score beside the data sheet's numbers.

        """
        tied, rest = _tied(self._ranked(leader, chosen, columns, least, sheet or {}))
        found = self.compared(tied)
        settled, more = next(filter(self.suffices, found), None), list(parts(found))
        refine = [s for s in more if settled and not is_joint(s.variant)]
        joins = [s for s in more if s not in refine]
        if joined := self._ranked(leader, joins, columns, least, {}):
            tied, rest = _tied([*joined, *rest])
            found += self.compared(tied, found)
        others = [place for _, place in rest]
        if settled:
            others += self._refining(settled, leader, refine, columns)
        return found + self.compared(others, found)

    def _refining(
        self, settled: Fitted, leader: Fitted, chosen: Sequence[Scored], columns: Sequence[Array]
    ) -> list[Place]:
        """Parts beside a leader, as far as they gain, at the numbers of a law that suffices."""
        found = list[Place]()
        for k, s in enumerate(chosen, 1):
            if self.grey.counter.stop():
                break
            self.tell(f"score test of {s.variant.key} ({k} of {len(chosen)})")
            own = part_score(self.grey, leader.point, columns, s.variant, leader.noise)
            if own.gain > threshold("hopeless"):
                size = s.variant.extra[len(leader.point.variant.extra)]
                scored = {size.path: size.value(float(own.start[len(leader.point.theta)]))}
                theta = refining(self.grey, settled, replace(s, start=scored))
                found.append((replace(leader.point, variant=s.variant, theta=theta), leader.noise))
        return found

    def _ranked(
        self,
        leader: Fitted,
        chosen: Sequence[Scored],
        columns: Sequence[Array],
        least: float,
        sheet: Mapping[str, Scored],
    ) -> list[_Ranked]:
        """Laws that gain enough under the leader's noise, best first."""
        grey, point = self.grey, leader.point
        over, believed = inflation(point), self.leaves_noise(leader)
        refits: list[Place] = []
        for k, s in enumerate(chosen, 1):
            if grey.counter.stop():
                break
            self.tell(f"refitting {s.variant.key} ({k} of {len(chosen)})")
            far = None if believed else sheet.get(s.variant.key, s)
            if own := refitted(self.estimator, grey, leader, s, columns, far):
                refits.append(own)
                gain = point.minus_two_log - own[0].minus_two_log
                self.leader.meets(s.variant.key, own[0].minus_two_log, f"gain {gain / over:.3g}")
        if not refits:
            return []
        # what the best of them leaves is nearest to noise: its colour weighs the gains of all; and
        # what the leader itself would gain by as many steps is no law's
        over = min([over, *(inflation(p) for p, _ in refits)])
        again = fit(
            grey, point.variant, point.theta, leader.gains, steps=5,
            shared_columns=columns[: grey.shared],
        )  # fmt: skip
        nothing = min(point.minus_two_log, again.minus_two_log)
        gains = {p.variant.key: (nothing - p.minus_two_log) / over for p, _ in refits}
        self.tried.update(gains)
        looked = [
            (gains[place[0].variant.key] - 2.0 * np.log(place[0].variant.looks), place)
            for place in refits
        ]
        looked.sort(key=lambda x: -x[0])
        best = with_rivals([own for own in looked if own[0] > least], self.effort.finals)
        return [(gains[place[0].variant.key], place) for place in best]

    def on_these(self, found: Sequence[Fitted]) -> list[Fitted]:
        """What was found on stretches of these records, on all of them.

        What fails elsewhere is refitted on stretches where it does first, and begins there if that
        is the likelier beginning: of what holds elsewhere these stretches may tell less.
        """
        places = list[Place]()
        for f in found:
            there = on_all_samples(self.grey, f)
            if there.inflation > threshold("inflation"):
                self.tell(f"stretches where {f.variant.key} fails")
                few = some(self.grey, there.point, there.gains, int(threshold("stretches")))
                own = self.estimator.likeliest(few, f.variant, f.point.theta, f.noise, roughly=True)
                again = on_all_samples(self.grey, own) if own else there
                there = min(there, again, key=lambda x: x.point.minus_two_log)
            places.append((there.point, there.noise))
        return self.compared(places)

    def compared(self, places: Sequence[Place], known: Sequence[Fitted] = ()) -> list[Fitted]:
        """Laws at their best, each under the noise that it leaves itself.

        Once one suffices, the others are fitted under its noise: what is far from it there does not
        come near by more unknown torque. Unless the library declares it to be what that one is
        taken for: under so little torque a fit may get stuck on its way.

        Args:
            places: of every law, where it stands.
            known: laws that they are compared with.

        """
        found, behind = list[Fitted](), list[Fitted]()  # all, and those before one sufficed
        far_off = list[Point]()
        settled = next((f for f in known if self.suffices(f)), None)
        columns: list[Array] | None = None
        for point, noise in sorted(places, key=lambda place: place[0].minus_two_log):
            if self.grey.counter.stop():
                break
            theta = point.theta
            if settled:
                self.tell(f"{point.variant.key} under the noise of {settled.variant.key}")
                columns = columns or slopes(
                    self.grey, settled.point, range(self.grey.shared), settled.gains
                )
                begins = self._begins(settled, point)
                far = settled.point.minus_two_log + threshold("beyond") * settled.inflation
                there = self.estimator.under(
                    self.grey, point.variant, begins, settled.noise, columns, rival=far
                )
                near = there is not None and _near(there, settled)
                if there is not None and not near and not confused(settled.variant, point.variant):
                    far_off.append(point)
                    continue
                if there and (near or there.point.minus_two_log < point.minus_two_log):
                    theta, noise = there.point.theta, settled.noise
            self.tell(f"the noise beside {point.variant.key}")
            lead = min((f.point.minus_two_log for f in [*known, *found]), default=-np.inf)
            own = self.estimator.likeliest(self.grey, point.variant, theta, noise, rival=lead)
            if own is None:
                continue
            found.append(own)
            if settled is None and self.suffices(own):
                settled, behind = own, found[:-1]
        enough = filter(self.suffices, [*known, *found])
        best = min(enough, key=lambda f: f.point.minus_two_log, default=None)
        if best is None:
            return found
        # what may be taken for the best of them was far from the first of them, no more
        alike = [p for p in far_off if best is not settled and confused(best.variant, p.variant)]
        others = [own for p in alike if (own := self._beside(best, p))]
        return [self._at_its_best(f, best) if f in behind else f for f in found] + others

    def _begins(self, settled: Fitted, point: Point) -> list[Array]:
        """Where a law may begin beside one that suffices, shape (unknowns,) each."""
        begins = begins_beside(self.estimator.core, settled.point, point.variant, point.theta)
        beside = in_its_place(self.library, self.grey, settled, point.variant)
        return begins if beside is None else [*begins, beside]

    def _at_its_best(self, f: Fitted, best: Fitted) -> Fitted:
        """What a law that suffices is taken for, once more from its numbers if it stayed behind."""
        if f is best or _near(f, best) or not confused(best.variant, f.variant):
            return f
        own = self._beside(best, f.point)
        return own if own and own.point.minus_two_log < f.point.minus_two_log else f

    def _beside(self, best: Fitted, point: Point) -> Fitted | None:
        """A law once more, from the numbers of one that suffices; None where it is lost."""
        self.tell(f"{point.variant.key} from the numbers of {best.variant.key}")
        places = [(theta, best.noise) for theta in self._begins(best, point)]
        seen = [p for p in self.grey.likelihoods(point.variant, places) if p]
        if not seen or self.grey.counter.stop():
            return None
        theta = min(seen, key=lambda p: p[0].minus_two_log)[0].theta
        lead = best.point.minus_two_log
        return self.estimator.likeliest(self.grey, point.variant, theta, best.noise, rival=lead)


def _tied(ranked: Sequence[_Ranked]) -> tuple[list[Place], list[_Ranked]]:
    """What is nearly as good as the best, with what that is taken for; and the rest."""
    most = max((gain for gain, _ in ranked), default=0.0)
    first = [own for own in ranked if own[0] > threshold("tied") * most]
    first += [
        own
        for own in ranked
        if own not in first and any(confused(t[0].variant, own[1][0].variant) for _, t in first)
    ]
    return [place for _, place in first], [own for own in ranked if own not in first]


def _near(f: Fitted, leader: Fitted) -> bool:
    """Whether it may come out as likely as the leader, under a noise of its own."""
    behind = f.point.minus_two_log - leader.point.minus_two_log
    return behind < threshold("beyond") * leader.inflation
