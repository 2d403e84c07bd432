"""The machines behind the figures. The paper prints no parameter: each set is a choice, stated."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any, Final

from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.run import Run
from dualdrive.simulation import simulate

__all__ = [
    "ARCSEC",
    "GAP_HALF",
    "STEP",
    "UNIT_SINE_HZ",
    "frictionless",
    "heavy_table",
    "short",
    "simulated",
    "untuned",
]

ARCSEC: Final = pi / 648000

#: rad at the table: the "unit step" of the paper; a whole radian would only show the speed limit
STEP: Final = 1e-3

#: rad at the pinion, half of the play of the heavy table
GAP_HALF: Final = 1.1e-3

#: the "unit sine" is taken as 1 rad/s
UNIT_SINE_HZ: Final = 1.0 / (2.0 * pi)


def heavy_table(load: str, numbers: Mapping[str, float] | None = None) -> Machine:
    """The preset heavy table (empty, 100t, 250t or 550t) with these numbers, SI, by path."""
    machine = Machine.load(f"heavy-table-{load}")
    for path, value in (numbers or {}).items():
        machine.set(path, value)
    return machine


def frictionless(**controller: float) -> Machine:
    """The empty table without dry friction, whose controller has these numbers.

    Dry friction isn't in the paper's model.
    """
    machine = heavy_table("empty")
    for label in machine.effects:
        if label.startswith("coulomb"):
            machine.remove(label)
    for name, value in controller.items():
        machine.set(f"controller.{name}", value)
    return machine


def simulated(machine: Machine, motion: Motion, **options: Any) -> Run:
    """The machine through a motion; options are those of `simulate`.

    Raises RuntimeError where the run stops early: nothing is read off a part of it.
    """
    run = simulate(machine, motion, energy=False, **options)
    if not run.ok:
        raise RuntimeError(f"{machine.name}, {motion.text}: {run.status}: {run.message}")
    return run


def untuned(gain: float, gap: float, tension: float = 0.0) -> Machine:
    """The machine of figure 4: proportional gain K_v (1/s) with an integral time of 0.5 s.

    gap: half of it, rad at the pinion; 0 for none. tension: N m.
    """
    machine = frictionless(K_v=gain, K_i=gain / 0.5, k_p=8e4, T_N=0.1, T_ten=tension, f_v=0.0)
    machine.set("meshes.gap", gap)
    return machine


def short(number: float) -> str:
    """Three digits: 8e4 rather than 8e+04."""
    return f"{number:.3g}".replace("e+0", "e").replace("e+", "e")
