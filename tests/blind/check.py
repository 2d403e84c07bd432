"""python -m tests.blind check [--effects coulomb wear] [--seed 7] [-o table.txt]

Every effect of the generator on a drawn machine of its own, simulated again by dualdrive with the
true numbers and the effect in it: how far the two noise-free records are apart, in units of the
sensors' noise, with the effect and without it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from tests.blind.generator import cases, effects, machines, records, sensors
from tests.blind.generator.effects import Hidden, UnfitError
from tests.blind.generator.engine import Array, EngineError
from tests.blind.generator.records import Plan
from tests.blind.generator.sensors import Recorder

from dualdrive import Machine, motion, simulate

_ATTEMPTS = 40
_SHARE = 0.1
_SMOOTH_KNOT = 5e-4


@dataclass(frozen=True)
class Agreement:
    """rms of what lies between two courses of a channel over that of its noise, the worst one."""

    effect: str
    place: str
    motion: str
    channel: str
    apart: float
    without: float


def main(arguments: Sequence[str]) -> int:
    """Print the table; 1 where an effect of the product is another one than the generator's."""
    parser = argparse.ArgumentParser(prog="tests.blind check", description=main.__doc__)
    parser.add_argument("--effects", nargs="+", default=sorted(effects.EFFECTS))
    parser.add_argument("--seed", type=int, default=0)
    told = parser.parse_args(arguments)
    print(
        f"{'effect':28s} {'place':12s} {'motion':14s} {'worst':8s} "
        f"{'apart':>10s} {'without it':>12s}"
    )
    worst = 0.0
    for name in told.effects:
        one = agreement(name, told.seed)
        worst = max(worst, one.apart)
        print(
            f"{one.effect:28s} {one.place:12s} {one.motion:14s} {one.channel:8s} "
            f"{one.apart:10.2g} {one.without:12.2g}",
            flush=True,
        )
    return int(worst > 1.0)


def agreement(effect: str, seed: int) -> Agreement:
    """On the first machine from that seed on which the effect can be and no flank hunts."""
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([seed, attempt, *effect.encode()])
        try:
            return _agreement(effect, rng)
        except (UnfitError, EngineError):
            continue
    raise RuntimeError(f"{effect}, seed {seed}: {_ATTEMPTS} draws, none fit")


def _agreement(effect: str, rng: np.random.Generator) -> Agreement:
    machine = machines.draw(rng)
    plans = records.plans(machine, rng)
    recorder = sensors.draw(machine, plans[0].sample, rng)
    plan = plans[0]
    made = plan.truth(machine)
    cases.check(plan, made, machine)
    if cases.hunts(made):
        raise UnfitError("hunts")
    setting = records.setting(machine, plans[:1], [made])
    hidden = effects.draw(effect, setting, int(rng.integers(2**31)), _SHARE)
    real = {path: value for path, value in machine.items() if path not in hidden.without}
    truth = plan.truth(real, (hidden,))
    cases.check(plan, truth, machine)
    if cases.hunts(truth):
        raise UnfitError("hunts")
    apart = distances(truth, simulated(real, plan, (hidden,), truth), recorder)
    without = distances(truth, simulated(real, plan, (), truth), recorder)
    channel = max(apart, key=lambda name: apart[name])
    return Agreement(
        hidden.effect,
        hidden.place,
        plan.motion.kind,
        channel,
        apart[channel],
        max(without.values()),
    )


def distances(
    one: Mapping[str, Array], other: Mapping[str, Array], of: Recorder
) -> dict[str, float]:
    """By channel: rms of the difference over that of the noise, constants apart but table's."""
    made = {}
    for name, values in other.items():
        change = values - one[name]
        change = change if name == "theta_m" else change - change.mean()
        sensor = of.sensors[name]
        made[name] = float(np.sqrt(np.mean(change**2))) / float(
            np.hypot(sensor.rms, sensor.step / 12**0.5)
        )
    return made


def simulated(
    numbers: Mapping[str, float], plan: Plan, hidden: Iterable[Hidden], truth: Mapping[str, Array]
) -> dict[str, Array]:
    """The record as dualdrive makes it, of that machine with those effects."""
    machine = Machine.from_toml(machines.text(dict(numbers), "truth"), "truth")
    if "controller.T_ten" in numbers:
        machine.set("controller.T_ten", plan.T_ten)
    hidden = tuple(hidden)
    for one in hidden:
        machine.add(one.effect, _place(one.place), **_numbers(one, plan))
    drives = range(1, int(numbers["drives"]) + 1)
    names = ["theta_m", *(f"theta_{n}" for n in drives), *(f"I_{n}" for n in drives)]
    run = simulate(
        machine,
        command(plan),
        end=float(plan.lead + truth["t"][-1]),
        times=plan.lead + truth["t"],
        signals=names,
        energy=False,
    )
    made = {name: np.asarray(run[name]) for name in names}
    for one in hidden:
        for name in _sensed(one, names):
            made[name] = _reading(one, truth["t"], made[name])
    return made


def _numbers(one: Hidden, plan: Plan) -> dict[str, float]:
    """Parameters by the clock of a simulation, which begins with the lead."""
    later = {"start": plan.lead} if one.effect == "cutting_torque" else {}
    return {key: value + later.get(key, 0.0) for key, value in one.parameters.items()}


def _sensed(one: Hidden, names: Iterable[str]) -> list[str]:
    """Channels that a sensor of the loop reads otherwise; simulated are the angles themselves."""
    if one.equation != "sensors" or one.recorder:
        return []
    if one.place == "table":
        return ["theta_m"]
    ending = effects.at(one.place)
    return [n for n in names if n.startswith("theta_") and n != "theta_m" and n.endswith(ending)]


def _reading(one: Hidden, t: Array, angle: Array) -> Array:
    if one.effect == "encoder_eccentricity":
        turn = angle + one.parameters["phase"]
        return np.asarray(angle + one.parameters["amplitude"] * np.cos(turn))
    late = np.maximum(t - one.parameters["time"], t[0])
    return np.asarray(CubicSpline(t, angle)(late))


def command(plan: Plan) -> motion.Motion:
    """The plan's command, begun after its lead."""
    made = plan.motion
    every = max(1, round(_SMOOTH_KNOT / made.length))
    straight = made.kind in ("ramps", "steps")
    angles = np.append(made.pieces[:, 0], made.pieces[-1, 2])
    times = plan.lead + np.arange(len(angles)) * made.length
    if straight:
        return motion.sampled(times, angles, interpolation="linear")
    return motion.sampled(times[::every], angles[::every])


def _place(place: str) -> str:
    return "table" if place == "ring" else place
