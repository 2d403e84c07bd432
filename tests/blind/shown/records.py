"""What is run and recorded: motions, tension, start, sensors, clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator import engine, machines
from tests.blind.generator.effects import Hidden, Setting
from tests.blind.generator.records import bad_amplifier, late, merge
from tests.blind.shown import families, motion, noise

Array = NDArray[np.float64]
STEP = 2e-5
LOOP = ("theta_m", "theta_1", "theta_2", "I_1", "I_2")
BALANCE = ("theta_m", "theta_1", "theta_2", "T_1", "T_2")


@dataclass(frozen=True)
class Plan:
    """One record as it is ordered: motion, settings of the drive, what came before.

    lead: s that the loop has stood before the record begins; 0: it is switched on with it
    """

    name: str
    jerks: motion.Jerks
    end: float
    sample: float
    lead: float
    T_ten: float
    speed: float
    travel: float

    def truth(
        self,
        machine: Mapping[str, float],
        effects: tuple[Hidden, ...] = (),
        step: float = STEP,
    ) -> dict[str, Array]:
        """Noise-free channels of that machine, of the drive's own sensors, each of shape (n,)."""
        numbers = machines.engine_numbers(machine)
        numbers |= {"T_ten": self.T_ten, "begin": -self.lead, "end": self.end}
        numbers |= {"output_step": self.sample, "step": step}
        for one in effects:
            merge(numbers, one.numbers)
        made = engine.run({k: v for k, v in numbers.items() if k[0] != "@"}, self.jerks)
        for one in effects:
            if one.recorder:
                made = late(made, *one.recorder)
        made = bad_amplifier(made, numbers.get("@gain", 0.0), numbers.get("@cross", 0.0))
        return made | {f"T_{n}": machine["motors.K_d"] * made[f"I_{n}"] for n in (1, 2)}


def plans(family: str, machine: Mapping[str, float], rng: np.random.Generator) -> tuple[Plan, ...]:
    """Two records: fast and slow, with two tensions, one of them off at times."""
    kind = families.FAMILIES[family]
    fast, a, j = (float(rng.uniform(*kind[key])) for key in ("v", "a", "j"))
    lead = 0.0 if rng.random() < 0.3 else float(kind["settle"])
    sample = 4e-3 if rng.random() < 0.2 else 2e-3
    usual = machine["controller.T_ten"]
    other = 0.0 if rng.random() < 0.4 else usual * float(rng.uniform(0.3, 2.0))
    made = []
    for name, v, tension in (("fast", fast, usual), ("slow", fast * rng.uniform(0.3, 0.6), other)):
        made.append(_plan(name, float(v), a, j, rng, lead=lead, sample=sample, T_ten=tension))
    return tuple(made)


def _plan(name: str, v: float, a: float, j: float, rng: np.random.Generator, **how: float) -> Plan:
    """There and back with reversals, standing in between; about four seconds and a half."""
    ramp = v / a + a / j
    often = rng.random() < 0.4
    length = v * max(0.3, rng.uniform(1.2, 1.6) * (0.7 if often else 1.0) - ramp)
    there = [1.0, -0.35, 0.35, -1.0] if often else [1.0, -1.0]
    if rng.random() < 0.3:
        there = [-share for share in there]
    pieces = [(share * length, v, a, j) for share in there]
    dwells = [
        float(rng.uniform(0.5, 0.9) if k == 0 or not often else rng.uniform(0.15, 0.5))
        for k in range(len(there) + 1)
    ]
    jerks, end = motion.course(pieces, dwells)
    end = round(end / 4e-3) * 4e-3
    tension = float(f"{how.pop('T_ten'):.4g}")
    return Plan(name, jerks, end, speed=v, travel=length, T_ten=tension, **how)


def setting(machine: Mapping[str, float], both: tuple[Plan, ...]) -> Setting:
    """What effects are scaled by."""
    rated = machine["motors.T_rated"] * machine["gearboxes.ratio"]
    runs = [plan.truth(machine, step=2 * STEP) for plan in both]
    return Setting(
        machine=machine,
        speed=max(p.speed for p in both),
        travel=max(p.travel for p in both),
        rated_deflection=rated / machine["meshes.stiffness"],
        peak_torque=max(float(np.abs(run[f"T_{n}"]).max()) for run in runs for n in (1, 2)),
        end=min(p.end for p in both),
        sample=max(p.sample for p in both),
    )


@dataclass(frozen=True)
class Recorder:
    """Sensors by channel, and a clock that jitters by so many seconds rms."""

    sensors: Mapping[str, noise.Sensor]
    jitter: float
    seed: int

    def read(
        self, plan: Plan, truth: Mapping[str, Array], channels: tuple[str, ...]
    ) -> dict[str, Array]:
        """Recorded columns, `t` and `theta_ref` (closed loop only) first."""
        rng = np.random.default_rng([self.seed, len(plan.name)])
        read = {"t": noise.jitter(truth["t"], self.jitter, rng)}
        if channels is LOOP:
            read["theta_ref"] = truth["theta_ref"]
        for name in channels:
            read[name] = self.sensors[name].read(truth[name], plan.sample, rng)
        return read


def recorder(family: str, K_d: float, rng: np.random.Generator) -> Recorder:
    """Sensors of that family's quality, on a clock that jitters in seven cases of ten."""
    kind = families.FAMILIES[family]["sensors"]
    sensors = {}
    for name in LOOP:
        rms, step = kind[name if name in kind else name.split("_")[0]]
        sensors[name] = noise.draw(rms, step, rng)
    for n in (1, 2):
        current = sensors[f"I_{n}"]
        sensors[f"T_{n}"] = replace(current, rms=current.rms * K_d, step=current.step * K_d)
    late = 0.0 if rng.random() < 0.3 else float(1e-6 * 30 ** rng.uniform(0, 1))
    return Recorder(sensors, late, int(rng.integers(2**31)))


def headline(sheet: Mapping[str, float], made: Mapping[str, Array]) -> dict[str, Array]:
    """Following error, currents or torques, deflections at the meshes."""
    shown = {"e": made["theta_ref"] - made["theta_m"]} if "theta_ref" in made else {}
    shown |= {k: made[k] for k in ("I_1", "I_2") if k in made and "theta_ref" in made}
    shown = shown or {k: made[k] for k in ("T_1", "T_2")}
    i, i_m = sheet["gearboxes.ratio"], sheet["meshes.ratio"]
    return shown | {f"x_{n}": made[f"theta_{n}"] / i - i_m * made["theta_m"] for n in (1, 2)}
