"""Machines to order: a sheet, the truth behind it, and the records that it makes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator import cases, effects, machines
from tests.blind.generator.effects import Hidden
from tests.blind.shown import families, records
from tests.blind.shown.records import LOOP, Plan, Recorder

from dualdrive import Machine
from dualdrive.diagnose import Diagnosis, diagnose
from dualdrive.traces import Trace

Array = NDArray[np.float64]
FAMILIES = tuple(families.FAMILIES)
assert cases.GROUPS  # cases enters all effects


@dataclass(frozen=True)
class Order:
    """One machine: what its sheet says, what it is, what is hidden in it, how it is recorded.

    hidden:   name of a plan -> effects of that record
    channels: those that the drive stores, beside time and command
    """

    name: str
    sheet: Mapping[str, float]
    real: Mapping[str, float]
    plans: tuple[Plan, ...]
    recorder: Recorder
    hidden: Mapping[str, tuple[Hidden, ...]]
    channels: tuple[str, ...] = LOOP

    def machine(self) -> Machine:
        """What the user has."""
        return Machine.from_toml(machines.text(self.sheet, "table"), self.name)

    def traces(self) -> dict[str, Trace]:
        """What the user has recorded, by name."""
        return {plan.name: self.trace(plan) for plan in self.plans}

    def trace(self, plan: Plan) -> Trace:
        """One record as the drive stores it."""
        truth = plan.truth(self.real, self.hidden.get(plan.name, ()))
        read = self.recorder.read(plan, truth, LOOP)
        stored = {name: read[name] for name in ("theta_ref", *self.channels)}
        return Trace(read["t"], stored, name=plan.name)

    def settings(self) -> dict[str, dict[str, float]]:
        """How the drive was set for each record."""
        return {plan.name: {"controller.T_ten": plan.T_ten} for plan in self.plans}

    def diagnosed(self, budget: float, **options: Any) -> Diagnosis:
        """What the product says, told nothing else."""
        return diagnose(
            self.machine(), self.traces(), settings=self.settings(), budget=budget, **options
        )


def drifted(family: str, seed: int, off: float) -> Order:
    """The sheet's table inertia is `off` times the real one; all else is exact."""
    rng = np.random.default_rng([seed, 1])
    real = families.draw(family, rng)
    sheet = {**real, "table.J": off * real["table.J"]}
    plans = records.plans(family, real, rng)
    recorder = records.recorder(family, real["motors.K_d"], rng)
    return Order(f"{family} {seed}, J x{off:g}", sheet, real, plans, recorder, {})


def hiding(effect: str, family: str, seed: int, share: float, count: int = 2) -> Order:
    """The sheet is 5 to 10 % off and lacks an effect; share: of a strong one; count: of records."""
    rng = np.random.default_rng([seed, 3])
    sheet = families.draw(family, rng)
    plans = records.plans(family, sheet, rng)[:count]
    one = effects.draw(effect, records.setting(sheet, plans), seed, share)
    sheet = {path: value for path, value in sheet.items() if path not in one.without}
    recorder = records.recorder(family, sheet["motors.K_d"], rng)
    hidden = {plan.name: (one,) for plan in plans}
    name = f"{family} {seed}, {effect} {share:g}"
    return Order(name, sheet, families.drift(sheet, rng), plans, recorder, hidden)


def loaded(family: str, seed: int, share: float) -> Order:
    """In the middle of every record a load sets in at the table, and stays.

    share: of one motor's rated torque, at the table. The sheet is 5 to 10 % off, as in the suite.
    """
    rng = np.random.default_rng([seed, 2])
    sheet = families.draw(family, rng)
    real = families.drift(sheet, rng)
    plans = records.plans(family, sheet, rng)
    torque = share * records.setting(sheet, plans).table_torque * float(rng.choice([-1, 1]))
    hidden = {plan.name: (_step(torque, plan.end * rng.uniform(0.35, 0.65)),) for plan in plans}
    recorder = records.recorder(family, sheet["motors.K_d"], rng)
    name = f"{family} {seed}, load {share:g}"
    return Order(name, sheet, real, plans, recorder, hidden)


def _step(torque: float, at: float) -> Hidden:
    numbers = {"cut": torque, "cut_from": at, "cut_to": 1e9}
    return Hidden("cutting_torque", "table", "table", numbers, {"mean": torque, "start": at})
