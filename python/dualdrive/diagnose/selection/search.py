"""Forward selection of laws by likelihood, the noise estimated beside every leader.

A torque of unknown course bears what a model lacks: estimated by likelihood it is large where a
law is missing and small once the right one is in. A refit begins with much of it (any machine
follows the record then) and ends with the least that the records allow, where all of their
information counts
(Kristensen, Madsen, Jørgensen, Computers & Chemical Engineering 28 (2004) 1431-1449).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.screening import Library, Scored, scores
from dualdrive.identify import FitError
from dualdrive.innovations import (
    GreyBox,
    Noise,
    Point,
    Variant,
    first_noise,
    fit,
    inflation,
    maximum_likelihood,
)

Array = NDArray[np.float64]

_WIDE = 0.1  # of the drives' torque: unknown course at first
_FLOOR = 1e-5  # of the drives' torque: the least unknown torque, so that a filter stays steady
_SHARE = 0.02  # of all that is explained: what a number must bring, for no law is exact
_SCORINGS = 25  # steps of an estimate of numbers and noise together
_VALLEYS = 3  # of a part that are followed on
_LOWER = (1.0, 0.2, 0.04)  # of the unknown torque at first: where valleys tell themselves apart
_BEGINS = (1.0, 0.3, 0.1, 3.0, 10.0)  # where the first number of a part begins, times its usual one
_HOPELESS = 3.0  # gain of a score test, over the inflation, below which no refit is worth it
_WORTH = 25.0  # gain in -2 log L, over the inflation, that a further effect must bring


@dataclass(frozen=True)
class Effort:
    """How much is tried.

    refitted: laws refitted beside a base, best scores first
    finals:   of them, how many under a noise of their own
    most:     effects at once
    """

    refitted: int
    finals: int
    most: int


EFFORTS = {
    "quick": Effort(4, 2, 2),
    "normal": Effort(8, 3, 3),
    "thorough": Effort(20, 5, 3),
}


@dataclass(frozen=True, eq=False)
class Fitted:
    """A variant at its best, under the noise that it leaves itself.

    criterion: -2 log L over the inflation, plus the price of every number, plus what was searched
    """

    point: Point
    noise: Noise
    inflation: float
    criterion: float
    gains: Sequence[Any] = field(repr=False)

    @property
    def variant(self) -> Variant:
        """What was fitted."""
        return self.point.variant


@dataclass(frozen=True, eq=False)
class Selection:
    """What a search found.

    base:     nothing but refitted numbers
    finals:   best first, `base` among them
    screened: every score test that was done, best gain first: (beside what, score)
    tried:    label -> gain of laws refitted under a base's noise, over the inflation
    finished: False: it was stopped
    """

    base: Fitted
    finals: Sequence[Fitted]
    screened: Sequence[tuple[str, Scored]]
    tried: dict[str, float]
    finished: bool

    @property
    def best(self) -> Fitted:
        """The leader."""
        return self.finals[0]


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
        self.core, self.grey, self.effort, self.tell = core, grey, effort, tell
        self.library = Library(core, grey)
        self.screened: list[tuple[str, Scored]] = []
        self.tried: dict[str, float] = {}
        self.finals: dict[str, Fitted] = {}
        self.wide = first_noise(core, grey.records, _WIDE)
        self.floor = first_noise(core, grey.records, _FLOOR).torque

    def run(self) -> Selection:
        base = self._base()
        self.finals[base.variant.key] = base
        leader = base
        for count in range(self.effort.most):
            if self.grey.counter.stop():
                break
            found = self._step(leader, parts=count == 0)
            self._keep(found)
            if found:
                richer = min(found, key=self._criterion)
                if simpler := self._without(richer, leader.variant):
                    self._keep([simpler])
                leader = self.finals[leader.variant.key]
            best = min(self.finals.values(), key=lambda f: self._criterion(f))
            if best is leader or self._criterion(best) > self._criterion(leader) - _WORTH:
                break
            leader = best
        own = (replace(f, criterion=self._criterion(f)) for f in self.finals.values())
        every = sorted(own, key=lambda f: f.criterion)
        order = sorted(self.screened, key=lambda s: -np.nan_to_num(s[1].gain, nan=-np.inf))
        base = next(f for f in every if f.variant.key == base.variant.key)
        return Selection(base, every, order, self.tried, not self.grey.counter.stop())

    def _keep(self, found: Sequence[Fitted]) -> None:
        for f in found:
            known = self.finals.get(f.variant.key)
            if known is None or f.point.minus_two_log < known.point.minus_two_log:
                self.finals[f.variant.key] = f

    def _without(self, richer: Fitted, variant: Variant) -> Fitted | None:
        """The variant without the last effect, from the numbers and the noise found with it.

        What is gained by an effect is told against the simpler machine at its own best, which a
        search from the data sheet may have missed.
        """
        self.tell(f"{variant.key} from the numbers of {richer.variant.key}")
        theta = richer.point.theta[: self.grey.shared + len(variant.extra)]
        return self._likeliest(variant, theta, richer.noise)

    def _criterion(self, f: Fitted) -> float:
        """Under the inflation of the best, lest a bad model's colour speaks for it."""
        least = min((g.inflation for g in self.finals.values()), default=f.inflation)
        best = min((g.point.minus_two_log for g in self.finals.values()), default=0.0)
        nothing = self.finals.get("nothing", f).point.minus_two_log
        price = np.log(self.grey.samples) + _SHARE * max(0.0, nothing - best) / least
        numbers = len(f.variant.extra) * price + 2.0 * np.log(f.variant.looks)
        return float(f.point.minus_two_log / least + numbers)

    def _final(self, point: Point) -> Fitted | None:
        """A variant under its own noise; None where it can't be followed.

        From much unknown torque and sensors as their records alone have them: a noise that a worse
        machine left would hold it back.
        """
        grey, variant = self.grey, point.variant
        try:
            wide = grey.gains(variant, point.theta, self.wide)
        except ValueError:
            return None
        near = fit(grey, variant, point.theta, wide, refresh=(0, 2, 4))
        return self._likeliest(variant, near.theta, self.wide)

    def _likeliest(self, variant: Variant, theta: Array, noise: Noise) -> Fitted | None:
        """Numbers and noise together, from a point; None where it can't be followed."""
        found = maximum_likelihood(
            self.grey, variant, theta, noise, floor=self.floor, steps=_SCORINGS
        )
        if found is None:
            return None
        point, own, gains = found
        return Fitted(point, own, inflation(point), 0.0, gains)

    def _base(self) -> Fitted:
        """Nothing is missing: numbers alone, from far."""
        self.tell("refitting the data sheet's numbers")
        grey = self.grey
        nothing = Variant(self.core)
        theta = grey.start(nothing)
        [point] = grey.points([nothing], [theta], grey.gains(nothing, theta, self.wide))
        found = self._final(point)
        if found is None:
            raise FitError(f"{self.core.name}: no Kalman filter follows these records")
        return found

    def _step(self, leader: Fitted, parts: bool) -> list[Fitted]:
        """Every law beside the leader: screened, the best refitted, their noise estimated."""
        grey = self.grey
        noise, point, gains = leader.noise, leader.point, leader.gains
        over = inflation(point)
        columns = grey.columns(point, range(len(point.theta)), gains)
        variants = self.library.variants(leader.variant, leader.point)
        beside = leader.variant.label
        self.tell(f"{len(variants)} laws beside {beside}")
        found = scores(
            grey, point, columns, variants, gains, over,
            lambda done, of: self.tell(f"score tests beside {beside}: {done} of {of}"),
        )  # fmt: skip
        self.screened += [(beside, s) for s in found]
        refits: list[Point] = []
        chosen = self._chosen(found, parts)
        for k, s in enumerate(chosen, 1):
            if grey.counter.stop():
                break
            self.tell(f"refitting {s.variant.key} ({k} of {len(chosen)})")
            own = self._refit(point, s, columns, gains, noise)
            if not own.lost:
                refits.append(own)
        # what the best of them leaves is nearest to noise: its colour weighs the gains of all
        over = min([over, *map(inflation, refits)])
        gains_of = {p.variant.key: (point.minus_two_log - p.minus_two_log) / over for p in refits}
        self.tried.update(gains_of)
        looked = [(gains_of[p.variant.key] - 2.0 * np.log(p.variant.looks), p) for p in refits]
        looked.sort(key=lambda x: -x[0])
        best = _one_each([p for gain, p in looked if gain > _WORTH])[: self.effort.finals]
        return self._compared(best)

    def _compared(self, points: Sequence[Point]) -> list[Fitted]:
        """Laws, each under the noise that it leaves itself, and from the best one's numbers."""
        found = []
        for point in points:
            if self.grey.counter.stop():
                break
            self.tell(f"the noise beside {point.variant.key}")
            final = self._final(point)
            if final is not None:
                found.append(final)
        if len(found) < 2:
            return found
        best = min(found, key=lambda f: f.point.minus_two_log)
        known = self.grey.shared
        for k, f in enumerate(found):
            if f is best or self.grey.counter.stop():
                continue
            self.tell(f"{f.variant.key} from the noise of {best.variant.key}")
            theta = np.r_[best.point.theta[:known], f.point.theta[known:]]
            again = self._likeliest(f.variant, theta, best.noise)
            if again and again.point.minus_two_log < f.point.minus_two_log:
                found[k] = again
        return found

    def _chosen(self, found: Sequence[Scored], parts: bool) -> list[Scored]:
        """What is refitted: the best scores, and parts whose probe says little of their size."""
        known = [s for s in found if np.isfinite(s.gain)]
        known.sort(key=lambda s: -(s.gain - 2.0 * np.log(s.variant.looks)))
        best = [s for s in known if s.gain > _HOPELESS][: self.effort.refitted]
        far = [s for s in found if s not in best and _is_part(s.variant)] if parts else []
        return best + far

    def _refit(
        self, point: Point, s: Scored, columns: Sequence[Array], gains: Sequence[Any], noise: Noise
    ) -> Point:
        grey, variant = self.grey, s.variant
        start = np.r_[point.theta, grey.start(variant)[len(point.theta) :]]
        for k, p in enumerate(variant.extra, grey.shared):
            if p.path in s.start:
                start[k] = p.coordinate(min(max(s.start[p.path], p.low), p.high))
        if not _is_part(variant):
            shared = columns[: grey.shared]
            return fit(grey, variant, start, gains, steps=5, shared_columns=shared, refresh=(2,))
        # a part softens or frees what the numbers had stood for: from the data sheet, through much
        # unknown torque, and into more than one valley
        start[: grey.shared] = grey.start(Variant(self.core))
        begins = []
        for factor in _BEGINS:
            there = start.copy()
            there[len(point.theta)] *= factor
            begins.append(there)
        for lower in _LOWER:
            own = self.wide.with_torque(lower)
            found = [p for p in (self._under(variant, x, own) for x in begins) if p]
            found.sort(key=lambda p: p.minus_two_log)
            begins = [p.theta for p in found[:_VALLEYS]]
        best = self._under(variant, begins[0], noise) if begins else None
        return best or replace(point, variant=variant, lost=True)

    def _under(self, variant: Variant, theta: Array, noise: Noise) -> Point | None:
        """Fitted with gains of its own; None where it is lost."""
        try:
            gains = self.grey.gains(variant, theta, noise)
        except ValueError:
            return None
        found = fit(self.grey, variant, theta, gains, refresh=(0, 2, 4))
        return None if found.lost else found


def _is_part(variant: Variant) -> bool:
    """Whether its last effect is a part of the machine with states of its own."""
    return bool(_core.effect_type(variant.effects[-1][0]).structural)


def _one_each(points: Sequence[Point]) -> list[Point]:
    """The best of each label: orders of one law are one law."""
    found: dict[str, Point] = {}
    for p in points:
        found.setdefault(p.variant.label, p)
    return list(found.values())
