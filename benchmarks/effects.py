"""The engines that step, on machines whose laws are not affine: which is fastest at equal error.

    python benchmarks/effects.py                two tables: runs, and slopes by twenty parameters
    python benchmarks/effects.py --write        into docs/performance.md as well

Every run replays ten seconds that were sampled at 1 kHz, recorded at 1 kHz. Errors are those of
the worst state over its own peak, against the finest tolerance of what `auto` takes; `agreement`
says how near CVODE's BDF method comes to that at its finest. Times are processor time, the best
of several rounds in which the engines take turns.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from operator import itemgetter
from typing import Any

import numpy as np

import page
import report
import surroundings
from case import SPAN, Array
from measure import Point, at_equal_error, in_turn

import core_machines  # isort: skip  (case.py finds the tests' folder)
import reference_model as reference
from dualdrive import _core

STATES = ["omega_c1", "omega_c2", "mesh_1.twist", "mesh_2.twist", "I_1", "I_2", "theta_m",
          "omega_m"]  # fmt: skip
ENGINES: dict[str, dict[str, Any]] = {
    "exponential": {"engine": "exponential"},
    "explicit": {"engine": "explicit"},
    "Adams": {"engine": "cvode", "method": "adams"},
    "BDF": {"engine": "cvode", "method": "bdf"},
    "auto": {"engine": "auto"},
}
RTOLS = (1e-6, 1e-8, 1e-10, 1e-12)
FINEST = 1e-13
MOST_STEPS = 300_000  # of a run that is timed
TARGETS = (1e-5, 1e-7)
SLOPES_RTOLS = (1e-6, 1e-8, 1e-10)
SLOPES_TARGET = 1e-6
PARAMETERS = [
    *("table.J", "table.b"),
    *(f"pinion_{n}.b" for n in (1, 2)),
    *(f"mesh_{n}.{name}" for name in ("stiffness", "gap") for n in (1, 2)),
    *(f"motor_{n}.{name}" for name in ("K_d", "R", "L") for n in (1, 2)),
    *(f"controller.{name}" for name in ("K_v", "f_v", "k_p", "T_N", "T_ten", "g_E")),
]


# ---------------------------------------------------------------------------------- workloads


def heavy(*effects: tuple[str, str, dict[str, float]], dry: bool = False) -> _core.Machine:
    """A table with 100 t, its drives pulled against each other, and effects at places."""
    machine = core_machines.core_machine(
        reference.heavy_table(100, dry_friction=dry).control(T_ten=10.0)
    )
    return with_effects(machine, *effects)


def with_effects(
    machine: _core.Machine, *effects: tuple[str, str, dict[str, float]]
) -> _core.Machine:
    for effect, place, values in effects:
        core_machines.set_all(machine, machine.add_effect(effect, place), values)
    return machine


def on_motors(effect: str, **values: float) -> list[tuple[str, str, dict[str, float]]]:
    return [(effect, f"motor_{n}", values) for n in (1, 2)]


def formula(place: str, text: str, **values: float) -> _core.Machine:
    machine = heavy()
    machine.add_expression(place, text, [(name, "", value) for name, value in values.items()])
    return machine


def lag() -> _core.Machine:
    machine = heavy(*on_motors("torque_ripple", amplitude=0.05, order=12))
    machine.set("controller.delta_t", 0.02)
    return machine


STRIBECK = {"torque": 2e3, "static_ratio": 1.3, "speed": 2e-3}
LUGRE = {"torque": 2e3, "speed": 2e-3, "stiffness": 2e8, "damping": 1e5}
BRISTLES = {"torque": 0.5, "stiffness": 1e5, "damping": 1.0, "speed": 1.0}
RIPPLE = {"amplitude": 0.02, "order": 24}

#: how each machine is made; the last turns stiff whenever its motors run
WORKLOADS: dict[str, Callable[[], _core.Machine]] = {
    "stribeck at the table": partial(heavy, ("stribeck", "table", STRIBECK)),
    "lugre at the table": partial(heavy, ("lugre", "table", LUGRE)),
    "eccentric ring and pinion": partial(
        heavy,
        ("eccentricity", "table", {"amplitude": 3e-4, "spacing": 1.0}),
        ("eccentricity", "pinion_2", {"amplitude": 2e-4, "phase": 1.0}),
    ),
    "cogging, dry friction": partial(
        heavy, *on_motors("cogging", amplitude=2.0, order=24), dry=True
    ),
    "torque ripple, dry friction": partial(
        heavy, *on_motors("torque_ripple", amplitude=0.05, order=12), dry=True
    ),
    "drag by speed squared": partial(formula, "table", "-c * speed * abs(speed)", c=1e7),
    "tanh friction": partial(formula, "pinion_1", "-a * tanh(speed / v)", a=300, v=1e-2),
    "torque ripple, slave lag": lag,
    "torque ripple, late encoder": partial(
        heavy,
        ("sensor_delay", "table", {"time": 2e-3}),
        *on_motors("torque_ripple", amplitude=0.05, order=12),
    ),
    "torque ripple, many impacts": lambda: with_effects(
        core_machines.core_machine(reference.speed_study("H")),
        *on_motors("torque_ripple", **RIPPLE),
    ),
    "lugre at the motors, stiff": partial(heavy, *on_motors("lugre", **BRISTLES)),
}
SLOPED = ("stribeck at the table", "eccentric ring and pinion", "torque ripple, many impacts")
UNEVEN = 1.01  # times the other gap: of two contacts at one instant no derivative by either exists


def replayed() -> _core.Waveform:
    t = np.linspace(0.0, SPAN, round(SPAN * 1e3) + 1)
    return _core.sampled(t, 0.02 * np.sin(np.pi * t), _core.Interpolation.cubic)


@dataclass(frozen=True)
class Workload:
    name: str

    @cached_property
    def machine(self) -> _core.Machine:
        return WORKLOADS[self.name]()

    def run(
        self, engine: str, rtol: float, slopes: Sequence[str] = (), max_steps: int = MOST_STEPS
    ) -> core_machines.Run:
        raw = _core.simulate(
            self.machine, {"theta_ref": replayed()}, end=SPAN, rtol=rtol, signals=STATES,
            sensitivities=list(slopes), energy=False, max_steps=max_steps, **ENGINES[engine],
        )  # fmt: skip
        if raw.status != "success":
            raise RuntimeError(f"{self.name}, {engine}, rtol {rtol:g}: {raw.message}")
        return core_machines.Run(raw)

    def finest(self, engine: str) -> Array:
        return np.asarray(self.run(engine, FINEST, max_steps=10 * MOST_STEPS).raw.values)

    @cached_property
    def truth(self) -> Array:
        return self.finest("auto")

    def error(self, values: Array) -> float:
        worst = np.abs(values - self.truth).max(axis=0)
        return float((worst / np.abs(self.truth).max(axis=0)).max())


def timed(do: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time in ms, and what was done."""
    begin = time.process_time()
    run = do()
    return 1e3 * (time.process_time() - begin), run


# ------------------------------------------------------------------------------------- tables


def points(work: Workload, rounds: int) -> list[Point]:
    """Every engine at every tolerance; what takes too many steps has an infinite error."""

    def run(engine: str, rtol: float) -> tuple[float, float, int, int]:
        ms, found = timed(partial(work.run, engine, rtol))
        raw = found.raw
        return ms, work.error(raw.values), len(raw.events), int(raw.statistics["rhs"])

    return in_turn(ENGINES, RTOLS, rounds, run)


def row_of_runs(work: Workload, rounds: int) -> list[str]:
    found = points(work, rounds)
    cells = [work.name, str(found[-1].events)]
    for target in TARGETS:
        for engine in ENGINES:
            ms = at_equal_error([p for p in found if p.engine == engine], target)
            cells.append(f"{ms / SPAN:.2f}" if ms else "-")
    chosen = work.run("auto", RTOLS[0]).raw.statistics["method"]
    return [*cells, chosen, f"{work.error(work.finest('BDF')):.0e}"]


def slopes_of(run: core_machines.Run) -> Array:
    """Shape (times, states, parameters), each parameter's by itself as large as it is at most."""
    slopes = np.asarray(run.raw.sensitivities)
    peak = np.abs(slopes).max(axis=0)
    return np.asarray(slopes / np.where(peak > 0, peak, 1.0))


def rows_of_slopes(work: Workload, rounds: int) -> list[list[str]]:
    """The error is the median over states and parameters of the worst over time."""
    work.machine.set("mesh_2.gap", UNEVEN * work.machine.get("mesh_2.gap"))
    true = slopes_of(work.run("explicit", FINEST, PARAMETERS, 10 * MOST_STEPS))
    rows = []
    for engine in ("exponential", "explicit", "Adams", "BDF", "auto"):
        found = []
        for rtol in SLOPES_RTOLS:
            plain = min(timed(partial(work.run, engine, rtol))[0] for _ in range(rounds))
            sloped = partial(work.run, engine, rtol, PARAMETERS, 10 * MOST_STEPS)
            ms, run = min((timed(sloped) for _ in range(rounds)), key=itemgetter(0))
            error = float(np.median(np.abs(slopes_of(run) - true).max(axis=0)))
            found.append((Point(engine, rtol, ms, error, len(run.raw.events)), ms / plain))
        equal = at_equal_error([point for point, _ in found], SLOPES_TARGET)
        rows.append(
            [work.name, engine]
            + [f"{p.ms / SPAN:.0f} ({ratio:.0f}x), {p.error:.0e}" for p, ratio in found]
            + [f"{equal / SPAN:.0f}" if equal else "-"]
        )
    return rows


def text(rounds: int) -> str:
    head = ["machine", "switches"]
    for target in TARGETS:
        head += [f"{engine} at {target:.0e}" for engine in ENGINES]
    runs = [row_of_runs(Workload(name), rounds) for name in WORKLOADS]
    slopes = [row for name in SLOPED for row in rows_of_slopes(Workload(name), rounds)]
    of_slopes = ["machine", "engine", *(f"rtol {rtol:.0e}" for rtol in SLOPES_RTOLS)]
    return "\n".join(
        [
            f"Milliseconds per simulated second at equal error; -: more than {MOST_STEPS} steps.",
            "",
            report.table([*head, "auto takes", "agreement"], runs),
            "",
            f"Slopes by {len(PARAMETERS)} parameters: milliseconds per simulated second, how many "
            "times a plain run of the same engine and tolerance that is, and the error.",
            "",
            report.table([*of_slopes, f"at error {SLOPES_TARGET:.0e}"], slopes),
        ]
    )


def main() -> None:
    parser = page.command_line(str(__doc__))
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    print(report.surroundings_text(surroundings.describe()), "\n")
    tables = text(given.rounds)
    print(tables)
    if given.write:
        page.write("effects", tables)


if __name__ == "__main__":
    main()
