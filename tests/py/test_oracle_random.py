"""Random dual drives with every limit, friction, damping and control option, against the exact
solution: trajectories and each contact.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from core_machines import apart, nearest_times, run_like
from reference_model import (
    Controller,
    Drive,
    Machine,
    Motion,
    bench,
    heavy_table,
    load_ramp,
    move,
    simulate,
    sine,
    step,
)

pytestmark = pytest.mark.usefixtures("both_engines")

MACHINES, BLOCK = 40, 8


class Draw:
    """Random numbers about given ones."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def near(self, value: float, spread: float = 0.5) -> float:
        return float(value * np.exp(self.random.uniform(-spread, spread)))

    def chance(self, probability: float) -> bool:
        return bool(self.random.random() < probability)

    def maybe(self, value: float, otherwise: float, probability: float = 0.6) -> float:
        return self.near(value) if self.chance(probability) else otherwise

    def pair(self, level: float) -> tuple[float, float]:
        return (self.near(level), self.near(level)) if self.chance(0.6) else (0.0, 0.0)


def random_drive(draw: Draw, drive: Drive, dry_friction: float) -> Drive:
    torque = draw.near(drive.K_d, 0.2)
    return replace(
        drive, J_d=draw.near(drive.J_d), J_c=draw.near(drive.J_c), b_c=draw.near(drive.b_c),
        R=draw.near(drive.R), L=draw.near(drive.L), K_d=torque, C_e=torque,
        K_t=draw.near(drive.K_t), gap=draw.maybe(drive.gap, 0.0, 0.9),
        c=draw.maybe(drive.c, 0.0), friction=draw.pair(dry_friction),
        T_max=draw.maybe(drive.T_max / 6, drive.T_max, 0.5),
        U_max=draw.maybe(drive.U_max / 8, drive.U_max, 0.4),
    )  # fmt: skip


def random_controller(draw: Draw, law: Controller) -> Controller:
    receivers = [(-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0)]
    return replace(
        law, K_v=draw.near(law.K_v), k_p=draw.near(law.k_p), T_N=draw.maybe(law.T_N, inf),
        K_i=draw.maybe(law.K_v, 0.0, 0.5), K_d=draw.maybe(0.3, 0.0, 0.4),
        Omega_max=draw.maybe(law.Omega_max / 3, law.Omega_max, 0.4), K_E=draw.near(law.K_E),
        T_E=draw.maybe(law.T_E, inf), Omega_E=draw.maybe(law.Omega_E / 10, law.Omega_E, 0.5),
        T_ten=draw.maybe(law.T_ten, 0.0), tau_t=draw.maybe(law.tau_t, 0.0),
        w=float(draw.random.uniform(0.3, 0.7)), equalises=receivers[draw.random.integers(3)],
    )  # fmt: skip


def random_case(seed: int) -> tuple[Machine, Motion]:
    draw = Draw(seed)
    heavy = draw.chance(0.5)
    load = int(draw.random.choice([0, 100, 250, 550]))
    base = heavy_table(load, dry_friction=False) if heavy else bench()
    on_table, on_pinion = (2e3, 300.0) if heavy else (0.1, 0.02)
    first, second = (random_drive(draw, drive, on_pinion) for drive in base.drives)
    assert base.controller is not None
    machine = replace(
        base, drives=(first, second), controller=random_controller(draw, base.controller),
        friction=draw.pair(on_table),
    )  # fmt: skip
    size = 1.0 if heavy else 10.0
    v, a, j = 0.03 * size, 0.05 * size, 0.3 * size
    step_size = 2e-3 * size
    motions = [
        move(0.02 * size, v, a, j, start=0.1),
        sine(5e-3 * size, draw.near(1.0)),
        step(step_size, at=0.1) + move(0.01 * size, v, a, j, start=0.8, origin=step_size),
        step(step_size / 2, at=0.05) + load_ramp(1e5 if heavy else 1.0, start=0.3),
    ]
    return machine, motions[draw.random.integers(4)]


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, MACHINES, BLOCK))
def test_random_machines_follow_the_exact_solution(first: int) -> None:
    contacts = 0
    for seed in range(first, first + BLOCK):
        machine, motion = random_case(seed)
        exact = simulate(machine, motion, 1.5)
        seen = run_like(machine, motion, 1.5, rtol=1e-11)
        assert nearest_times(seen, exact) < 1e-6, seed
        assert apart(seen, exact) < 1e-5, seed
        contacts += len(exact.contacts)
    assert contacts > 20
