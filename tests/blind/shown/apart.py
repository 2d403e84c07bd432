"""The suggested experiment, carried out by the generator: does it part what was ambiguous?

Both explanations are refitted to the new record, the machine's numbers and the effect's within what
the old record left of them. They are parted if the right one leaves less by more
than DECIDED, twice the log of odds of 20 to 1. Beside it any experiment of the menu that the
machine survives, as large as it can do it.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from tests.blind.scoring.match import same_place
from tests.blind.shown.motion import Jerks
from tests.blind.shown.ordered import Order
from tests.blind.shown.preloaded import OLD, Alike

from dualdrive import parse_motion
from dualdrive.diagnose import Diagnosis
from dualdrive.diagnose.experiment import Limits, menu, next_experiment
from dualdrive.diagnose.experiment.distance import Noise, misfit
from dualdrive.diagnose.experiment.limits import axis_of
from dualdrive.diagnose.experiment.plan import Plan as Search
from dualdrive.diagnose.experiment.plan import Rival
from dualdrive.motion import Motion
from dualdrive.replay import core_of
from dualdrive.traces import Trace

NEW = "next"
DECIDED = 2 * math.log(20.0)
SECONDS = 40.0  # longest experiment, as `diagnose` asks for it
_SAMPLE, _KNOT = 8e-3, 2e-3  # s: of the new record, of the sampled reference that the drive follows
_STEPS = 6  # of a refit

Settings = Mapping[str, float]


@dataclass(frozen=True)
class Parted:
    """What came of one ambiguous record.

    ambiguous: both names in the group that the diagnosis could not part
    suggested, chance: by how much more the wrong explanation leaves of the new record; NaN where
        there was none
    """

    name: str
    verdict: str
    ambiguous: bool
    suggestion: str
    suggested: float
    chance: float


def parted(case: Alike, budget: float, seed: int) -> Parted:
    """Diagnose the record; carry out what is suggested, and one of the menu at random."""
    order = case.order
    found = order.diagnosed(budget)
    labels = [one for group in found.groups for one in group] or [
        c.label for c in found.candidates[:1]
    ]
    pair = (case.truth, case.rival)
    both = found.verdict == "ambiguous"
    both &= all(any(same(one, label) for one in labels) for label in pair)
    verdict = f"{found.verdict}: {', '.join(labels)}" if found.best else found.verdict
    told = Parted(order.name, verdict, both, "", math.nan, math.nan)
    rivals = [explanation(order, found, label) for label in pair]
    right, wrong = rivals
    if right is None or wrong is None:
        return told
    noise = known_noise(order)
    name, suggested, chance = "none", math.nan, math.nan
    if (best := suggestion(order, found, (right, wrong))) is not None:
        name, motion, settings = best
        suggested = margin(order, motion, settings, (right, wrong), noise)
    if (other := at_random((right, wrong), noise, random.Random(seed))) is not None:
        chance = margin(order, *other, (right, wrong), noise)
    return Parted(order.name, verdict, both, name, suggested, chance)


def same(label: str, other: str) -> bool:
    """Whether two labels mean one thing: motor and pinion turn as one."""
    (effect, _, place), (name, _, where) = label.partition("@"), other.partition("@")
    return effect == name and same_place(effect, place, where)


def explanation(order: Order, found: Diagnosis, label: str) -> Rival | None:
    """The refitted machine with that candidate, as far as the old record knows its numbers."""
    fitting = (c for c in found.candidates if c.parameters and same(c.label, label))
    candidate = next(fitting, None)
    if candidate is None:
        return None
    machine = order.machine()
    for effect, place in candidate.effects:
        machine.add(effect, place)
    every = {**found.numbers, **candidate.parameters}
    for path, number in every.items():
        machine.core.set(path, number.value)
    wide = {path: (p.high - p.low) / 3.92 for path, p in every.items()}
    known = {path: width for path, width in wide.items() if 0.0 < width < math.inf}
    return Rival(candidate.label, core_of(machine), known)


def suggestion(
    order: Order, found: Diagnosis, rivals: Sequence[Rival]
) -> tuple[str, Motion, Settings] | None:
    """The diagnosis' own where it has one for these two, else what it would plan for them."""
    best, pair = found.next_experiment, [rival.label for rival in rivals]
    if best is None or not all(any(same(a, b) for b in best.separates) for a in pair):
        noise = known_noise(order)
        best = next_experiment(
            [(rival.label, rival.core) for rival in rivals],
            noise=noise.rms,
            channels=list(noise.rms),
            spacing=noise.spacing,
            seconds=SECONDS,
            known={rival.label: rival.known for rival in rivals},
        )
    if best is None:
        return None
    return best.name, parse_motion(best.motion), best.settings


def at_random(
    rivals: Sequence[Rival], noise: Noise, rng: random.Random
) -> tuple[Motion, Settings] | None:
    """Any experiment of the menu that both explanations survive."""
    items = menu(axis_of(rivals[0].core, Limits()), SECONDS)
    search = Search(noise, Limits(), False, math.inf, lambda _: None)
    trials = (search.sized(rivals, item) for item in rng.sample(items, len(items)))
    trial = next((trial for trial in trials if trial is not None), None)
    return None if trial is None else (trial.motion, trial.item.settings)


def margin(
    order: Order, motion: Motion, settings: Settings, rivals: Sequence[Rival], noise: Noise
) -> float:
    """By how much more the second explanation leaves of an experiment's record than the first."""
    record = carried_out(order, motion, settings)
    left = []
    for rival in rivals:
        core = rival.core.copy()
        for path, value in settings.items():
            core.set(path, value)
        left.append(misfit(core, record, motion, noise, steps=_STEPS, known=rival.known)[0])
    right, wrong = left
    return wrong - right


def carried_out(order: Order, motion: Motion, settings: Settings) -> Trace:
    """The record that the real machine makes of a motion."""
    [old] = order.plans
    tension = settings.get("controller.T_ten", old.T_ten)
    end = math.floor(motion.end / _SAMPLE) * _SAMPLE
    plan = replace(old, name=NEW, jerks=jerks_of(motion), end=end, sample=_SAMPLE, T_ten=tension)
    other = {path: value for path, value in settings.items() if path != "controller.T_ten"}
    real = {**order.real, **other}
    return replace(order, real=real, hidden={NEW: order.hidden[OLD]}).trace(plan)


def jerks_of(motion: Motion) -> Jerks:
    """Pieces of constant jerk through the motion as a drive samples it; it begins at rest."""
    t = np.arange(0.0, motion.end, _KNOT)
    spline = CubicSpline(t, motion.waveform.value(t), bc_type=("clamped", "not-a-knot"))
    return list(zip(t[:-1].tolist(), (6.0 * spline.c[0]).tolist(), strict=True))


def known_noise(order: Order) -> Noise:
    """The sensors' own, by channel, and how far apart its samples are independent."""
    sensors = order.recorder.sensors
    names = order.channels
    rms = {n: math.hypot(sensors[n].rms, sensors[n].step / math.sqrt(12)) for n in names}
    slow = [sensors[n].coloured * 2 * sensors[n].correlation for n in names]
    return Noise(rms, _SAMPLE + max(slow))


def summary(rows: Sequence[Parted]) -> list[str]:
    """Shares: called ambiguous, parted as suggested, parted by chance."""
    told = [one for one in rows if one.ambiguous]
    planned = [one for one in rows if not math.isnan(one.suggested)]
    lines = [f"called ambiguous, both names in the group: {len(told)} of {len(rows)}"]
    for which, some in (("those", [one for one in told if one in planned]), ("all", planned)):
        own, other = (
            sum(value > DECIDED for value in values)
            for values in ([one.suggested for one in some], [one.chance for one in some])
        )
        lines.append(f"of {which}: suggested parts {own}, at random {other}, of {len(some)}")
    return lines
