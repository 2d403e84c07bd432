"""Trying the menu with two rivals: each motion as large as the machine can do, the best first."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.experiment import laws
from dualdrive.diagnose.experiment.catalogue import Item
from dualdrive.diagnose.experiment.distance import (
    Noise,
    effect_numbers,
    expected,
    misfit,
    twin,
)
from dualdrive.diagnose.experiment.limits import Limits, peaks
from dualdrive.motion import Motion, MotionError, parse_motion
from dualdrive.traces import Trace

Array = NDArray[np.float64]

#: squared distance that tells two explanations apart in 95 % of cases: Phi(sqrt(d)/2) = 0.95
TELLS_APART = 11.0
#: beyond this more distance is worth nothing, and the simplest experiment is taken
CERTAIN = 100.0
#: gentler sizes at which a motion beyond the limits is tried
_SIZES = (1.0, 0.7, 0.5, 0.3, 0.15, 0.07)
#: share of the simulations for trying; the rest is for refitting what leads
_SEARCH = 0.7
#: simulations that the slopes of one take
_SLOPES = 12
#: simulations of a machine that the exact engine takes, for which one of another machine stands
_NOT_AFFINE = 8
#: weight of what the right explanation leaves
_WILD = 10.0
#: Gauss-Newton steps of a full refit
_STEPS = 6


@dataclass(frozen=True)
class Rival:
    """An explanation: the machine fitted with it; known: path -> standard deviation, SI."""

    label: str
    core: Any
    known: Mapping[str, float] = field(default_factory=dict)

    def set(self, item: Item) -> Rival:
        """With the item's settings. ValueError where the machine has no such parameter."""
        core = self.core.copy()
        for path, value in item.settings.items():
            core.set(path, value)
        return replace(self, core=core)


@dataclass(frozen=True)
class Trial:
    """A planned experiment that both rivals survive, and how far apart it puts them."""

    item: Item
    motion: Motion
    distance: float
    final: bool = False


@dataclass(frozen=True, eq=False)
class Foreseen:
    """What a motion makes of a machine.

    load:   share of a motor's greatest torque that it takes; infinite where nothing comes of it
    record: channels over time, or torque at the table and the samples that count
    """

    load: float
    record: Trace | tuple[Array, Array] | None


class Plan:
    """One search: its noise and limits, and how many simulations it may take."""

    def __init__(
        self,
        noise: Noise,
        limits: Limits,
        linear: bool,
        simulations: float,
        progress: Callable[[str], None],
        stop: Callable[[], bool] = lambda: False,
    ) -> None:
        self.noise, self.limits, self.progress, self.stop = noise, limits, progress, stop
        self.axis = "linear" if linear else "rotary"
        self.simulations, self.done = simulations, 0
        self.left_out: list[str] = []

    def over(self, share: float = 1.0) -> bool:
        """Whether this share of the simulations is used up, or the user asked for an end."""
        return self.done >= share * self.simulations or self.stop()

    def count(self, core: Any, simulations: int) -> None:
        """Count what is about to be simulated."""
        self.done += simulations * _cost(core)

    def trials(self, pair: Sequence[Rival], planned: Sequence[Item]) -> list[Trial]:
        """What was tried, the best first; motions as the drives are set before other settings."""
        labels = " and ".join(rival.label for rival in pair)
        found: list[Trial] = []
        for changed in (False, True):
            for item in planned:
                if bool(item.settings) != changed or (found and self.over(_SEARCH)):
                    continue
                if self.over():
                    self.left_out.append(item.name)
                    continue
                self.progress(f"telling {labels} apart by {item.name}")
                trial = self.sized(pair, item)
                found += [] if trial is None else [trial]
            found.sort(key=_rank)
            if changed or (found and found[0].distance >= CERTAIN):
                self._settle(pair, found)
            if found and found[0].distance >= CERTAIN:
                break
        return found

    def _settle(self, pair: Sequence[Rival], found: list[Trial]) -> None:
        """Refit in full what leads by the first step of a refit, until one that was leads."""
        while found and not found[0].final and not self.over():
            first = found[0]
            own = [rival.set(first.item) for rival in pair]
            distance = self._distance(own, first.motion)
            found[0] = Trial(first.item, first.motion, distance, final=True)
            found.sort(key=_rank)
        sure = [trial for trial in found if trial.final and trial.distance >= TELLS_APART]
        if sure and not found[0].final:  # cut short: what is known goes before what is foretold
            found.insert(0, found.pop(found.index(sure[0])))

    def sized(self, pair: Sequence[Rival], item: Item) -> Trial | None:
        """The item as large as torque allows; None where the machines do not allow it."""
        try:
            own = [rival.set(item) for rival in pair]
        except ValueError:
            return None  # no such setting on this machine
        for size in _SIZES:
            try:
                motion = parse_motion(item.motion(size), axis=self.axis)
            except (MotionError, ZeroDivisionError):
                return None
            seen = [self._foreseen(rival.core, motion) for rival in own]
            if max(one.load for one in seen) <= self.limits.torque:
                truth, rival = _ways(own)[0]
                return Trial(item, motion, self._foretold(seen[truth], own[rival], motion))
        return None

    def _foreseen(self, core: Any, motion: Motion) -> Foreseen:
        """What a machine would record, or the torque that it would ask for."""
        if uncontrolled(core):
            law = laws.asked(core, motion)
            return Foreseen(math.inf if law is None else laws.share_of_limits(core, law[0]), law)
        self.count(core, 1)
        trace = expected(core, motion, list(self.noise.rms))
        return Foreseen(math.inf if trace is None else peaks(core, dict(trace.channels)), trace)

    def _distance(self, pair: Sequence[Rival], motion: Motion) -> float:
        """The smaller one of the ways round that count, each with other numbers of the truth."""
        tasks = list(zip(2 * _ways(pair), (1, -1), strict=False))
        for rival in pair:
            self.count(rival.core, _STEPS * (1 + _SLOPES))

        def refitted(task: tuple[tuple[int, int], int]) -> float:
            (truth, rival), sign = task
            return self._refitted(pair[truth], pair[rival], motion, sign)

        with ThreadPoolExecutor(len(tasks)) as pool:
            return min(pool.map(refitted, tasks))

    def _foretold(self, seen: Foreseen, rival: Rival, motion: Motion) -> float:
        """What the first step of a refit promises that the rival will leave."""
        if seen.record is None:
            return 0.0
        if isinstance(seen.record, tuple):
            return laws.apart(rival.core, seen.record, motion, self.noise, rival.known)
        self.count(rival.core, 1 + _SLOPES)
        found = misfit(rival.core, seen.record, motion, self.noise, steps=0, known=rival.known)[1]
        return found if math.isfinite(found) else 0.0

    def _refitted(self, truth: Rival, rival: Rival, motion: Motion, sign: int) -> float:
        """By how much more the rival leaves than the truth, whose own numbers are a little off.

        What the truth leaves counts tenfold: where no fit follows, as that of a drive loose in its
        play, the outcome hangs on chance, and a distance says nothing.
        """
        seen = self._foreseen(twin(truth.core, sign), motion)
        if not isinstance(seen.record, Trace):
            return self._foretold(seen, rival, motion)

        def left(one: Rival) -> float:
            assert isinstance(seen.record, Trace)
            given = (one.core, seen.record, motion, self.noise)
            return misfit(*given, steps=_STEPS, known=one.known)[0]

        wrong = left(rival)
        return wrong if wrong < TELLS_APART else max(0.0, wrong - _WILD * left(truth))


def _rank(trial: Trial) -> float:
    """Farthest apart first; beyond any doubt all are alike, and the order of the menu stands."""
    return -min(trial.distance, CERTAIN)


def uncontrolled(core: Any) -> bool:
    """Whether nobody knows the controller."""
    return bool(core.controller_options["kind"] == "none")


def _ways(pair: Sequence[Rival]) -> list[tuple[int, int]]:
    """(truth, rival), the rival that is refitted faster first.

    A rival with more numbers than the truth is not asked: where it imitates, parsimony refuses it.
    """
    count = [effect_numbers(rival.core) for rival in pair]
    ways = [(a, b) for a, b in ((0, 1), (1, 0)) if count[b] <= count[a]]
    return sorted(ways, key=lambda way: not _affine(pair[way[1]].core))


def _cost(core: Any) -> int:
    return 1 if _affine(core) else _NOT_AFFINE


def _affine(core: Any) -> bool:
    """Whether the exact engine takes the machine, many times as fast."""
    return all(
        e["effect"] != "expression" and _core.effect_type(e["effect"]).affine for e in core.effects
    )
