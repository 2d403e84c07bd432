"""The experiment that best separates the leading explanations."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

from dualdrive.diagnose.experiment import laws
from dualdrive.diagnose.experiment.distance import (
    Noise,
    effect_numbers,
    expected,
    misfit,
    unrepeatable,
)
from dualdrive.diagnose.experiment.limits import Limits, axis_of, peaks, same
from dualdrive.diagnose.experiment.menu import LEFT_OUT, Item, menu
from dualdrive.diagnose.result import Experiment
from dualdrive.motion import Motion, MotionError, parse_motion
from dualdrive.replay import core_of

#: squared distance that tells two explanations apart in 95 % of cases: Phi(sqrt(d)/2) = 0.95
TELLS_APART = 11.0
#: beyond this more distance is worth nothing, and the simplest experiment is taken
CERTAIN = 100.0
#: below this even the best experiment of the menu says nothing of a pair
_HOPELESS = 1.0
#: gentler sizes at which a motion beyond the limits is tried
_SIZES = (1.0, 0.7, 0.5, 0.3, 0.15, 0.07)
#: of the leading rivals; pairs of them are tried in turn until a pair can be told apart
_LEADING = 3
#: share of the time for trying; the rest is for refitting what leads
_SEARCH = 0.6
#: Gauss-Newton steps of a full refit
_STEPS = 8


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


def next_experiment(
    rivals: Sequence[tuple[str, Any]],
    *,
    noise: Mapping[str, float],
    channels: Sequence[str],
    seconds: float = 40.0,
    spacing: float = 5e-3,
    known: Mapping[str, Mapping[str, float]] | None = None,
    limits: Limits | None = None,
    budget: float = 30.0,
    files: tuple[str, str, str] = ("machine.toml", "old.csv", "next.csv"),
    progress: Callable[[str], None] | None = None,
) -> Experiment | None:
    """Plan what to measure next, so that the leading rivals part.

    Every motion of the menu is scaled to the machine, simulated with each of two rivals, and the
    record of the one fitted with the other, both ways; the smaller distance counts, but that of a
    rival with more numbers, which parsimony refuses where it imitates the other. The largest of
    the menu wins; of those beyond any doubt the simplest, and other settings of the drives are
    tried only where no motion is. Where a pair is the same under all, the next pair is tried.

    Args:
        rivals: label and fully fitted machine of each, its own effect in it, best first.
        noise: channel -> RMS noise, SI.
        channels: which to record, among those of `noise`; equations in a torque balance.
        seconds: longest an experiment may last.
        spacing: time between samples whose noise is independent, s: the sampling time times one
            plus twice the noise's correlation time in samples.
        known: label -> parameter path -> standard deviation that the fit left, SI; without it an
            effect's strength is taken as known to 20 %.
        limits: what the axis may be asked for; 80 % of torque and speed, one turn unless given.
        budget: s of computing; what is not done then is left out.
        files: names for the commands: machine, record so far, record to come.
        progress: told in words what is being tried.

    Returns:
        The experiment, or None with fewer than two rivals, or where no motion separates any two.

    Raises:
        ValueError: noise that lacks every channel, or a machine without any speed limit.

    """
    leading = [
        Rival(label, core_of(machine), dict((known or {}).get(label, {})))
        for label, machine in rivals[:_LEADING]
    ]
    if len(leading) < 2 or not same([rival.core for rival in leading]):
        return None
    rms = {name: noise[name] for name in channels if noise.get(name, 0.0) > 0.0} or {
        name: value for name, value in noise.items() if value > 0.0
    }
    if not rms:
        raise ValueError(f"noise: nothing above 0 for {', '.join(channels)}; give its RMS")
    linear = any(getattr(machine, "axis", "") == "linear" for _, machine in rivals)
    own = limits or Limits()
    planned = menu(axis_of(leading[0].core, own, linear=linear), seconds)
    pairs, end = list(combinations(leading, 2)), time.monotonic() + budget
    for left, pair in zip(range(len(pairs), 0, -1), pairs, strict=True):
        share = (end - time.monotonic()) / left
        plan = Plan(Noise(rms, spacing), own, linear, share, progress or (lambda _: None))
        trials = plan.trials(pair, planned)
        if trials and trials[0].distance >= _HOPELESS:
            return _told(pair, trials, files)
    return None


class Plan:
    """One search: its noise, limits and deadline."""

    def __init__(
        self,
        noise: Noise,
        limits: Limits,
        linear: bool,
        budget: float,
        progress: Callable[[str], None],
    ) -> None:
        self.noise, self.limits, self.progress = noise, limits, progress
        self.axis = "linear" if linear else "rotary"
        self.begin, self.budget = time.monotonic(), budget

    def late(self, share: float = 1.0) -> bool:
        """Whether this share of the time is over."""
        return time.monotonic() > self.begin + share * self.budget

    def trials(self, pair: Sequence[Rival], planned: Sequence[Item]) -> list[Trial]:
        """What was tried, the best first; motions as the drives are set before other settings."""
        labels = " and ".join(rival.label for rival in pair)
        found: list[Trial] = []
        for changed in (False, True):
            for item in planned:
                if bool(item.settings) == changed and not (found and self.late(_SEARCH)):
                    self.progress(f"telling {labels} apart by {item.name}")
                    trial = self.sized(pair, item)
                    found += [] if trial is None else [trial]
            self._settle(pair, found)
            if found and found[0].distance >= CERTAIN:
                break
        return found

    def _settle(self, pair: Sequence[Rival], found: list[Trial]) -> None:
        """Sort; refit in full what leads by the first step of a refit, until one refitted leads."""
        found.sort(key=_rank)
        while found and not found[0].final and not self.late():
            first = found[0]
            own = [rival.set(first.item) for rival in pair]
            distance = self._distance(own, first.motion, steps=_STEPS)
            found[0] = Trial(first.item, first.motion, distance, final=True)
            found.sort(key=_rank)

    def sized(self, pair: Sequence[Rival], item: Item) -> Trial | None:
        """The item as large as torque allows; None where the machines can't do it."""
        try:
            own = [rival.set(item) for rival in pair]
        except ValueError:
            return None  # no such setting on this machine
        for size in _SIZES:
            try:
                motion = parse_motion(item.motion(size), axis=self.axis)
            except (MotionError, ZeroDivisionError):
                return None
            load = max(self._load(rival.core, motion) for rival in own)
            if load <= self.limits.torque:
                distance = self._distance(own, motion, steps=0)
                return Trial(item, motion, distance) if math.isfinite(distance) else None
        return None

    def _load(self, core: Any, motion: Motion) -> float:
        """Share of a motor's greatest torque that the motion takes; infinite where it fails."""
        if _uncontrolled(core):
            law = laws.asked(core, motion)
            return math.inf if law is None else laws.share_of_limits(core, law[0])
        trace = expected(core, motion, list(self.noise.rms))
        return math.inf if trace is None else peaks(core, dict(trace.channels))

    def _distance(self, pair: Sequence[Rival], motion: Motion, *, steps: int) -> float:
        """The smaller one of the ways round that count."""
        ways = list(_ways(pair))
        with ThreadPoolExecutor(len(ways)) as pool:
            return min(pool.map(lambda way: self._one_way(way[0], way[1], motion, steps), ways))

    def _one_way(self, truth: Rival, rival: Rival, motion: Motion, steps: int) -> float:
        noise, until = self.noise, self.begin + self.budget
        if _uncontrolled(truth.core):
            law = laws.asked(truth.core, motion)
            return 0.0 if law is None else laws.apart(rival.core, law, motion, noise, rival.known)
        record = expected(truth.core, motion, list(noise.rms))
        if record is None:
            return 0.0
        reached, foretold = misfit(
            rival.core, record, motion, noise, steps=steps, until=until, known=rival.known
        )
        if not steps:
            return foretold
        return reached / (1.0 + unrepeatable(truth.core, record, motion, noise, until=until))


def _told(
    pair: Sequence[Rival], trials: Sequence[Trial], files: tuple[str, str, str]
) -> Experiment:
    best = trials[0]
    labels = (pair[0].label, pair[1].label)
    return Experiment(
        best.item.name,
        best.motion.text,
        dict(best.item.settings),
        labels,
        best.distance,
        _reason(best, labels),
        {trial.item.name: trial.distance for trial in trials[1:]},
        _commands(best, files, closed_loop=not _uncontrolled(pair[0].core)),
    )


def _reason(best: Trial, labels: tuple[str, str]) -> str:
    why = best.item.why
    if best.distance < TELLS_APART:
        why += (
            f"; {TELLS_APART:g} would tell {labels[0]} from {labels[1]}: repeat it, or let it last"
        )
    if any(label.startswith("thermal") for label in labels):
        why += f"; {LEFT_OUT['cold and warm']}"
    return why


def _commands(best: Trial, files: tuple[str, str, str], *, closed_loop: bool) -> tuple[str, ...]:
    machine, old, new = files
    settings = best.item.settings.items()
    sets = "".join(f" --set {path}={value:g}" for path, value in settings)
    ours = "".join(f" --set-for {new}:{path}={value:g}" for path, value in settings)
    diagnose = f"dualdrive diagnose {machine} {old} {new}{ours}"
    if not closed_loop:  # nothing to simulate: the axis' own controller makes the motion
        return (diagnose,)
    motion = f"--motion '{best.motion.text}'{sets}"
    return (f"dualdrive simulate {machine} {motion} --plot expected.png", diagnose)


def _rank(trial: Trial) -> float:
    """Farthest apart first; beyond any doubt all are alike, and the order of the menu stands."""
    return -min(trial.distance, CERTAIN)


def _uncontrolled(core: Any) -> bool:
    return bool(core.controller_options["kind"] == "none")


def _ways(pair: Sequence[Rival]) -> Iterator[tuple[Rival, Rival]]:
    """(truth, rival): a rival with more numbers than the truth is not asked."""
    first, second = pair
    more = effect_numbers(second.core) - effect_numbers(first.core)
    if more <= 0:
        yield first, second
    if more >= 0:
        yield second, first
