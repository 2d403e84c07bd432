"""What is run and recorded: motions, tension, what came before, sample time, channels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from tests.blind.generator import engine, machines, motions
from tests.blind.generator.effects import Hidden, Setting
from tests.blind.generator.engine import Array
from tests.blind.generator.motions import Limits, Motion

Rng = np.random.Generator
RATES = (200, 250, 400, 500, 1000, 2000, 4000, 8000)
_TICK = 1.25e-4  # all sample times are multiples of it, and it of the step
_FOLLOWED = 0.06  # of a step times the fastest rate
_FOLLOWED_COARSELY = 0.4  # enough for differences between records that are made alike
MOST = 100_000  # samples in a case


@dataclass(frozen=True)
class Plan:
    """One record as it is ordered.

    lead: s that the loop has stood before the record begins; 0: it is switched on with it
    """

    name: str
    motion: Motion
    sample: float
    lead: float
    T_ten: float

    def truth(
        self, machine: Mapping[str, float], effects: Iterable[Hidden] = (), coarse: bool = False
    ) -> dict[str, Array]:
        """Noise-free channels as the drive's own sensors read them, each of shape (n,)."""
        numbers = machines.engine_numbers(machine)
        effects = tuple(effects)
        for one in effects:
            merge(numbers, one.numbers)
        step = self._step(numbers, coarse)
        numbers |= {"T_ten": self.T_ten, "begin": -self.lead, "end": self.motion.end}
        numbers |= {"output_step": self.sample, "step": step}
        told = {k: v for k, v in numbers.items() if k[0] != "@"}
        made = engine.run(told, knots=(self.motion.pieces, self.motion.length))
        for one in effects:
            if one.recorder:
                made = late(made, *one.recorder)
        made = bad_amplifier(made, numbers.get("@gain", 0.0), numbers.get("@cross", 0.0))
        K_d = machine["motors.K_d"]
        return made | {f"T_{n}": K_d * made[f"I_{n}"] for n in range(1, int(machine["drives"]) + 1)}

    def _step(self, numbers: Mapping[str, float], coarse: bool) -> float:
        """The longest step that divides every clock and follows the fastest rate."""
        clocks = [self.sample, *(v for k, v in numbers.items() if k.endswith("_sample") and v > 0)]
        tick = 2 * _TICK if coarse and min(clocks) >= 4 * _TICK else _TICK
        followed = _FOLLOWED_COARSELY if coarse else _FOLLOWED
        return float(tick / np.ceil(tick * machines.fastest(numbers) / followed))


def merge(numbers: dict[str, float], more: Mapping[str, float]) -> None:
    """Words beginning with + add to what the machine has."""
    for key, value in more.items():
        if key[0] == "+":
            numbers[key[1:]] = numbers.get(key[1:], 0.0) + value
        else:
            numbers[key] = value


def late(made: dict[str, Array], channel: str, delay: float) -> dict[str, Array]:
    """The recorder reads one channel late; before the record begins it held its first value."""
    t = made["t"]
    past = np.maximum(t - delay, t[0])
    return made | {channel: np.asarray(CubicSpline(t, made[channel])(past))}


def bad_amplifier(made: dict[str, Array], gain: float, cross: float) -> dict[str, Array]:
    """The recorder's channel of motor 1: a gain that grows in time, a share of motor 2."""
    if gain == 0 and cross == 0:
        return made
    share = 1 + gain * made["t"] / made["t"][-1]
    return made | {"I_1": share * made["I_1"] + cross * made.get("I_2", 0.0)}


def plans(machine: Mapping[str, float], rng: Rng) -> tuple[Plan, ...]:
    """One to eight records of any kinds, all on one clock."""
    sample = _sample(machine, rng)
    count = int(
        rng.choice([1, 2, 3, 4, 5, 6, 7, 8], p=[0.1, 0.2, 0.25, 0.15, 0.1, 0.08, 0.06, 0.06])
    )
    whole = min(float(rng.uniform(20, 40)), 0.95 * MOST * sample)
    able = limits(machine)
    shares = rng.dirichlet(np.full(count, 6.0))
    made = []
    for k in range(count):
        lead = 0.0 if rng.random() < 0.3 else _settling(machine)
        tension = _tension(machine, first=k == 0, rng=rng)
        end = max(2.0, float(shares[k] * whole))
        kind = str(rng.choice(_kinds(machine)))
        own = replace(able, speed=able.speed * float(10 ** rng.uniform(-0.6, 0)))
        motion = motions.draw(kind, end, sample, own, rng)
        made.append(Plan(f"{kind.replace(' ', '_')}_{k + 1}", motion, sample, lead, tension))
    return tuple(made)


def _sample(machine: Mapping[str, float], rng: Rng) -> float:
    """Sample time: one that shows the machine's own frequency, most often 1 ms."""
    lowest = 4 * machines.natural(machine) / (2 * np.pi)
    weights = np.array([2, 1, 1, 3, 8, 3, 1.5, 1])
    weights = np.where(np.array(RATES) >= min(lowest, 500), weights, 0.0)
    return 1.0 / float(rng.choice(RATES, p=weights / weights.sum()))


def limits(machine: Mapping[str, float]) -> Limits:
    """What rated torque and speed allow at the table; the answer is that of the position loop."""
    i, i_m, drives = machine["gearboxes.ratio"], machine["meshes.ratio"], machine["drives"]
    inertia = machine["table.J"] + drives * i_m**2 * machines.drive_inertia(machine)
    torque = drives * machine["motors.T_rated"] * i * i_m
    speed = 0.7 * machine["motors.omega_max"] / (i * i_m)
    answer = machine["controller.K_v"]
    return Limits(speed, 0.7 * torque / inertia, answer, machines.natural(machine))


def _kinds(machine: Mapping[str, float]) -> list[str]:
    """Jumps of the command are for loops without feed-forward."""
    rare = machine["controller.f_v"] == 0
    return [kind for kind in motions.KINDS if kind != "steps" or rare]


def _settling(machine: Mapping[str, float]) -> float:
    """Until tension and position have settled, in whole ticks of the slowest clock."""
    slow = 10 / machine["controller.K_v"] + 6 * machine.get("controller.tau_t", 0.0)
    slow += 4 * machine.get("controller.T_E", 0.0) + 2 * machine["controller.T_N"]
    return round(min(slow, 8.0) / 4e-3) * 4e-3


def _tension(machine: Mapping[str, float], first: bool, rng: Rng) -> float:
    """As on the sheet, another one, or none."""
    usual = machine.get("controller.T_ten", 0.0)
    if first or rng.random() < 0.6:
        return usual
    return 0.0 if rng.random() < 0.5 else float(f"{usual * rng.uniform(0.4, 1.6):.4g}")


def setting(
    machine: Mapping[str, float], ordered: tuple[Plan, ...], made: list[dict[str, Array]]
) -> Setting:
    """What effects are scaled by, from the records as they are without any."""
    torques = [one[f"T_{n}"] for one in made for n in range(1, int(machine["drives"]) + 1)]
    speeds = [np.abs(np.diff(one["theta_m"])) / ordered[0].sample for one in made]
    rated = machine["motors.T_rated"] * machine["gearboxes.ratio"]
    return Setting(
        machine=machine,
        speed=max(float(np.percentile(speed, 99.5)) for speed in speeds),
        travel=max(float(np.ptp(one["theta_m"])) for one in made),
        rated_deflection=rated / machine["meshes.stiffness"],
        peak_torque=max(float(np.abs(torque).max()) for torque in torques),
        end=min(plan.motion.end for plan in ordered),
        sample=ordered[0].sample,
    )
