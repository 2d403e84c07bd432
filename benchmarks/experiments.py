"""Does the suggested experiment tell two explanations apart, and more often than a random one?

    python benchmarks/experiments.py                    8 machines of every pair, about an hour
    python benchmarks/experiments.py --cases 2 --pair "stribeck or coulomb"

Each case: a machine whose numbers are off by up to 5 % and that has an effect its data sheet lacks
makes a record on which the effect and a rival look alike. Both are fitted to it; from the two fits
comes the suggestion. Then the machine carries it out, with other noise, and both explanations are
refitted: they are told apart if the right one leaves less by more than DECIDED, twice the log of
odds of 20 to 1. Beside it a random choice from the same menu, as large as the machine can do it.
"""

from __future__ import annotations

import argparse
import math
import random
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dualdrive import Machine, parse_motion
from dualdrive.demo import sheet
from dualdrive.diagnose.experiment import Limits, menu, next_experiment
from dualdrive.diagnose.experiment.distance import Noise, expected, misfit
from dualdrive.diagnose.experiment.limits import axis_of
from dualdrive.diagnose.experiment.plan import Plan, Rival, Trial
from dualdrive.identify import FitError, fit
from dualdrive.motion import Motion
from dualdrive.replay import core_of
from dualdrive.traces import Trace
from report import table

Settings = Mapping[str, float]

DECIDED = 2 * math.log(20.0)
#: RMS noise: 0.4 arcsec at the table, 10 arcsec at the motors, 0.5 A
RMS = {"theta_m": 2e-6, "theta_1": 5e-5, "theta_2": 5e-5, "I_1": 0.5, "I_2": 0.5}
SPACING = 4e-3
SECONDS = 15.0
OFF = 0.05  # of the numbers that data sheets state


@dataclass(frozen=True)
class Pair:
    """A missing effect, its rival, and a record on which they look alike."""

    name: str
    truth: tuple[str, Mapping[str, float]]
    rival: tuple[str, Mapping[str, float]]
    old: str
    channels: Sequence[str] = tuple(RMS)

    @property
    def noise(self) -> Noise:
        return Noise({name: RMS[name] for name in self.channels}, SPACING)


CURRENTS = ("theta_m", "I_1", "I_2")
PAIRS = (
    Pair(
        "coulomb: table or motors",  # preloaded reversals
        ("coulomb@table", {"torque": 60.0}),
        ("coulomb@motors", {"torque": 0.01}),
        "cycle:0.01;0,v=0.01,a=0.02,j=0.1,dwell=1,start=1,repeats=2",
        CURRENTS,
    ),
    Pair(
        "cogging or torque ripple",  # the same load throughout
        ("cogging@motor_1", {"amplitude": 0.04, "order": 24.0}),
        ("torque_ripple@motor_1", {"amplitude": 0.003, "order": 24.0}),
        "move:0.02,v=0.003,a=0.0005,j=0.001,start=1,settle=1",
    ),
    Pair(
        "stribeck or coulomb",  # one speed
        ("stribeck@table", {"torque": 80.0, "static_ratio": 1.4, "speed": 2e-3}),
        ("coulomb@table", {"torque": 80.0}),
        "cycle:0.03;0,v=0.02,a=0.05,j=0.5,dwell=1,start=1,repeats=2",
        CURRENTS,
    ),
    Pair(
        "loss by load or coulomb",  # the same tension throughout
        ("load_dependent_mesh_loss@pinions", {"fraction": 0.005}),
        ("coulomb@pinions", {"torque": 10.0}),
        "cycle:0.01;0,v=0.005,a=0.01,j=0.05,dwell=1,start=1,repeats=2",
        CURRENTS,
    ),
    Pair(
        "coulomb or lugre",  # long strokes
        ("lugre@table", {"torque": 400.0, "static_ratio": 1.0, "stiffness": 2e8, "damping": 1e5}),
        ("coulomb@table", {"torque": 400.0}),
        "move:0.05,v=0.02,a=0.05,j=0.5,start=1,settle=1",
        CURRENTS,
    ),
    Pair(
        "eccentricity: ring or pinion",  # a short arc
        ("eccentricity@table", {"amplitude": 1.5e-4, "phase": 0.5}),
        ("eccentricity@pinions", {"amplitude": 1e-5, "phase": 0.5}),
        "cycle:0.02;0,v=0.01,a=0.02,j=0.1,dwell=1,start=1,repeats=2",
    ),
)


def with_effect(machine: Machine, effect: tuple[str, Mapping[str, float]]) -> Machine:
    grown = machine.copy()
    grown.add(effect[0], **effect[1])
    return grown


def real(pair: Pair, rng: np.random.Generator) -> Machine:
    """The machine that is measured: what the data sheet lacks, and numbers that are off."""
    machine = with_effect(sheet(), pair.truth)
    for path in ("table.J", "motors.J", "meshes.stiffness", "meshes.gap", "table.b", "motors.b"):
        machine.set(path, machine.get(path) * (1 + OFF * rng.uniform(-1, 1)))
    return machine


def measured(core: Any, motion: Motion, noise: Noise, rng: np.random.Generator) -> Trace:
    """A record with white noise: as sure as samples `spacing` apart would be."""
    clean = expected(core, motion, list(noise.rms))
    assert clean is not None
    step = float(np.median(np.diff(clean.t)))
    noisy = {
        n: clean[n] + rng.normal(0.0, 1.0, len(clean)) / noise.weight(n, step) for n in noise.rms
    }
    return Trace(clean.t, noisy, name="next")


@dataclass(frozen=True)
class Explanation:
    """A rival fitted to the old record, and how well that record determines its numbers."""

    label: str
    machine: Machine
    known: Mapping[str, float]

    def left(self, record: Trace, motion: Motion, noise: Noise, settings: Settings) -> float:
        """What it leaves of a record after a refit."""
        core = set_up(self.machine, settings)
        return misfit(core, record, motion, noise, known=self.known)[0]


def explained(pair: Pair, trace: Trace, motion: Motion) -> list[Explanation]:
    """Both explanations fitted to the old record, the right one first."""
    found = []
    for effect in (pair.truth, pair.rival):
        fitted = fit(
            with_effect(sheet(), effect), trace, motion=motion, start="settled",
            max_simulations=60, rtol=1e-6,
        )  # fmt: skip
        known = {
            path: (p.high - p.low) / 3.92
            for path, p in fitted.parameters.items()
            if "@" in path and math.isfinite(p.high - p.low)
        }
        found.append(Explanation(effect[0], fitted.machine, known))
    return found


def set_up(machine: Machine, settings: Settings) -> Any:
    core = core_of(machine).copy()
    for path, value in settings.items():
        core.set(path, value)
    return core


def margin(
    pair: Pair,
    rivals: Sequence[Explanation],
    truth: Machine,
    motion: Motion,
    settings: Settings,
    rng: np.random.Generator,
) -> float:
    """By how much more the wrong explanation leaves of an experiment's record than the right."""
    record = measured(set_up(truth, settings), motion, pair.noise, rng)
    right, wrong = (rival.left(record, motion, pair.noise, settings) for rival in rivals)
    return wrong - right


def at_random(pair: Pair, rivals: Sequence[Explanation], rng: random.Random) -> Trial | None:
    """Any experiment of the menu that both machines survive."""
    both = [Rival(r.label, core_of(r.machine), r.known) for r in rivals]
    items = menu(axis_of(both[0].core, Limits()), SECONDS)
    plan = Plan(pair.noise, Limits(), False, math.inf, lambda _: None)
    trials = (plan.sized(both, item) for item in rng.sample(items, len(items)))
    return next((trial for trial in trials if trial is not None), None)


def case(pair: Pair, seed: int) -> tuple[float, float, float, str]:
    """Margins of the old record, the suggested experiment and a random one; what was suggested."""
    rng = np.random.default_rng(seed)
    truth, old = real(pair, rng), parse_motion(pair.old)
    trace = measured(core_of(truth), old, pair.noise, rng)
    rivals = explained(pair, trace, old)
    right, wrong = (rival.left(trace, old, pair.noise, {}) for rival in rivals)
    best = next_experiment(
        [(r.label, r.machine) for r in rivals],
        noise=pair.noise.rms,
        channels=pair.channels,
        seconds=SECONDS,
        spacing=SPACING,
        known={r.label: r.known for r in rivals},
    )
    chance = at_random(pair, rivals, random.Random(seed))
    suggested = other = 0.0
    if best:
        motion = parse_motion(best.motion)
        suggested = margin(pair, rivals, truth, motion, best.settings, rng)
    if chance:
        other = margin(pair, rivals, truth, chance.motion, chance.item.settings, rng)
    name = f"{best.name} ({best.expected_distance:.3g})" if best else "none"
    return wrong - right, suggested, other, name


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--cases", type=int, default=8, help="machines of every pair")
    arguments.add_argument("--pair", help="this pair only")
    asked = arguments.parse_args()
    rows, decided = [], np.zeros(3)
    count = 0
    for pair in PAIRS:
        if asked.pair and pair.name != asked.pair:
            continue
        found, begin = [], time.perf_counter()
        for seed in range(asked.cases):
            try:
                found.append(case(pair, seed))
            except FitError as error:
                print(f"{pair.name}, machine {seed}: {error}")
        if not found:
            continue
        told = np.array([[m > DECIDED for m in one[:3]] for one in found])
        decided, count = decided + told.sum(axis=0), count + len(found)
        names = ", ".join(dict.fromkeys(one[3].rpartition(" (")[0] for one in found))
        rows.append([pair.name, *(f"{share:.0%}" for share in told.mean(axis=0)), names])
        print(f"{pair.name}: {time.perf_counter() - begin:.0f} s")
        for one in found:
            print("   ", *(f"{m:10.1f}" for m in one[:3]), one[3], flush=True)
    rows.append(["all", *(f"{share:.0%}" for share in decided / max(count, 1)), ""])
    print(table(["pair", "old record", "suggested", "at random", "suggestions"], rows))


if __name__ == "__main__":
    main()
