"""What a law written by a user costs beside the same law compiled: formula, curve, effect.

    python benchmarks/user_laws.py

Twenty copies of one law, each of a twentieth, sit on one table under a driven motion, so that what
a law costs stands out of what a run costs. Times are processor time, the best of several rounds, of
the step-by-step engine at rtol 1e-8; a cost is what the copies add to the time of a step without
them, beside that of stribeck, a compiled law of usual size. The last column is of whole runs with
one copy, beside the first law of the same motion.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import report

import core_machines  # isort: skip  (case.py finds the tests' folder)
from case import reference
from dualdrive import _core

COPIES, SPAN = 20, 4.0
SLOPES = ["table.J", "table.b", "pinion_1.b", "pinion_2.b", "mesh_1.stiffness", "controller.K_v"]
DRAG, LIFT = 1e7, 2e3
#: name -> (family, adds one copy of a size to a machine)
Law = tuple[str, Callable[[_core.Machine, float], str]]


def effect(kind: str, **values: float) -> Callable[[_core.Machine, float], str]:
    strength = _core.effect_type(kind).parameters[0].path

    def add(machine: _core.Machine, share: float) -> str:
        label = machine.add_effect(kind, "table")
        own = values | {strength: values[strength] * share}
        core_machines.set_all(machine, label, own)
        return label

    return add


def formula(text: str, **values: float) -> Callable[[_core.Machine, float], str]:
    def add(machine: _core.Machine, share: float) -> str:
        own = [(k, "", v * (share if k == "a" else 1.0)) for k, v in values.items()]
        return str(machine.add_expression("table", text, own))

    return add


def curve(
    coordinate: str,
    low: float,
    high: float,
    n: int,
    law: Callable[[Any], Any],
    periodic: bool = False,
) -> Callable[[_core.Machine, float], str]:
    knots = np.linspace(low, high, n, endpoint=not periodic)

    def add(machine: _core.Machine, share: float) -> str:
        axis = (coordinate, low, high, n, periodic)
        return str(machine.add_spline("table", [axis], (share * law(knots)).tolist()))

    return add


def surface(machine: _core.Machine, share: float) -> str:
    axes = [("speed", -0.1, 0.1, 11, False), ("angle", 0.0, 2 * np.pi, 24, True)]
    speed, angle = np.linspace(-0.1, 0.1, 11), np.linspace(0, 2 * np.pi, 24, endpoint=False)
    values = share * LIFT * np.outer(np.tanh(speed / 0.02), 1 + 0.5 * np.cos(angle))
    return str(machine.add_spline("table", axes, values.ravel().tolist()))


LAWS: dict[str, Law] = {
    "coulomb": ("dry friction", effect("coulomb", torque=LIFT)),
    "stribeck": ("dry friction", effect("stribeck", torque=LIFT, speed=2e-3)),
    "hydrostatic_drag": ("drag", effect("hydrostatic_drag", quadratic=DRAG)),
    "expression -a*speed*abs(speed)": ("drag", formula("-a * speed * abs(speed)", a=DRAG)),
    "spline over speed, 11 knots": (
        "drag", curve("speed", -0.1, 0.1, 11, lambda w: -DRAG * w * np.abs(w))),
    "unbalance": ("lift", effect("unbalance", amplitude=LIFT, phase=0.5)),
    "expression a*cos(angle + p)": ("lift", formula("a * cos(angle + p)", a=LIFT, p=0.5)),
    "spline over angle, 24 knots": (
        "lift", curve("angle", 0.0, 2 * np.pi, 24, lambda a: LIFT * np.cos(a + 0.5), True)),
    "spline over speed and angle": ("lift", surface),
}  # fmt: skip


def table() -> _core.Machine:
    return core_machines.core_machine(reference.heavy_table(100).control(T_ten=10.0))


def run(machine: _core.Machine, slopes: bool, rounds: int) -> tuple[float, float]:
    """Processor time in ms, of a run and of a step of it."""
    best, steps = np.inf, 1
    for _ in range(rounds):
        begin = time.process_time()
        raw = _core.simulate(
            machine, {"theta_ref": _core.sine(0.02, 0.5)}, end=SPAN, rtol=1e-8, energy=False,
            engine="explicit", signals=["theta_m"], sensitivities=SLOPES if slopes else [],
        )  # fmt: skip
        best = min(best, 1e3 * (time.process_time() - begin))
        if raw.status != "success":
            raise RuntimeError(raw.message)
        steps = raw.statistics["steps"]
    return best, best / steps


def costs(slopes: bool, rounds: int) -> list[list[str]]:
    bare = table()
    core_machines.set_all(bare, bare.add_effect("unbalance", "table"), {"amplitude": 1.0})
    nothing = run(bare, slopes, rounds)[1]
    found: dict[str, tuple[float, float]] = {}
    first: dict[str, float] = {}
    for name, (family, add) in LAWS.items():
        many, one = table(), table()
        for _ in range(COPIES):
            add(many, 1.0 / COPIES)
        add(one, 1.0)
        own = (run(many, slopes, rounds)[1] - nothing) / (COPIES - 1)
        all_of_it = run(one, slopes, rounds)[1]
        found[name] = own, all_of_it / first.setdefault(family, all_of_it)
    usual = found["stribeck"][0]
    return [
        [name, f"{1e3 * own:.2f}", f"{own / usual:.1f}", f"{whole:.2f}"]
        for name, (own, whole) in found.items()
    ]


def main() -> None:
    rounds = report.count_asked(str(__doc__), "rounds", 3)
    head = ["law", "us per step", "to stribeck", "a run with one copy"]
    for slopes in (False, True):
        print(f"With slopes by {len(SLOPES)} parameters:\n" if slopes else "Plain runs:\n")
        print(report.table(head, costs(slopes, rounds)), "\n")


if __name__ == "__main__":
    main()
