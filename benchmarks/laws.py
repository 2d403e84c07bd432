"""What one law that is not affine costs on a machine, and whether `auto` takes the best engine.

    python benchmarks/laws.py                   every law on every machine, rtol 1e-6 and default
    python benchmarks/laws.py --machine bench --rtols 1e-6
    python benchmarks/laws.py --only stribeck lugre
    python benchmarks/laws.py --write           into docs/performance.md as well

Ten seconds of a sine, states recorded at 1 kHz; each effect at a size that is usual on the machine:
the bench with its current loops at 2500 1/s, and presets. Friction that is the whole friction of
the table replaces that of the preset. Errors are those of the worst state over its own peak,
against the explicit engine at rtol 1e-12 (`agreement`: how near BDF comes to it). Times are
processor time, the best of several rounds in which the engines take turns; `ratio` is that of
`auto` to the fastest engine at the same tolerance, `affine` that of `auto` to the machine without
the effect.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from itertools import product

import numpy as np

import page
import report
import surroundings
from case import Array
from effects import ENGINES, STATES, timed

import core_machines  # isort: skip  (case.py finds the tests' folder)
import usual_laws
from dualdrive import Machine, _core

SPAN = 10.0  # s
RTOLS = (1e-6, 1e-10)
FINEST = 1e-12
MOST_STEPS = 3_000_000
WHOLE_FRICTION = ("stribeck", "lugre")  # in place of dry friction that is there
DRY = "coulomb@table"


@dataclass(frozen=True)
class Setup:
    """A preset under a sine, far from its limits; amplitude in rad, frequency in Hz."""

    amplitude: float
    frequency: float
    laws: dict[str, tuple[tuple[str, ...], dict[str, float]]]
    numbers: dict[str, float] = field(default_factory=dict)


HEAVY = Setup(0.002, 0.25, usual_laws.HEAVY)  # a jump in speed that leaves torques below limits
#: preset -> what is done with it; motors reach 38 rad/s on the bench, 9 on heavy tables
MACHINES = {
    "bench": Setup(0.3, 0.5, usual_laws.LAWS, {"controller.omega_ci": 2500.0}),
    "heavy-table-empty": HEAVY,
    "heavy-table-550t": HEAVY,
    "heavy-table-dual-servo": HEAVY,
}
LAWS = list(usual_laws.LAWS)


def machine(name: str, *laws: str) -> _core.Machine:
    """One of MACHINES, with these laws."""
    setup = MACHINES[name]
    made: _core.Machine = Machine.load(name).core
    for path, value in setup.numbers.items():
        made.set(path, value)
    for law in laws:
        if law in WHOLE_FRICTION and DRY in [e["label"] for e in made.effects]:
            made.remove_effect(DRY)
        places, values = setup.laws[law]
        for place in places:
            core_machines.set_all(made, made.add_effect(law, place), values)
    return made


def run(name: str, made: _core.Machine, engine: str, rtol: float) -> _core.Trajectory:
    """The machine of that name under its sine; raises RuntimeError where the run fails."""
    setup = MACHINES[name]
    inputs = {"theta_ref": _core.sine(setup.amplitude, setup.frequency)}
    raw = _core.simulate(made, inputs, end=SPAN, rtol=rtol, signals=STATES, energy=False,
                         max_steps=MOST_STEPS, **ENGINES[engine])  # fmt: skip
    if raw.status != "success":
        raise RuntimeError(f"{name}, {engine}, rtol {rtol:g}: {raw.message}")
    return raw


def error(values: Array, truth: Array) -> float:
    """The worst state's largest error over its own peak; both of shape (times, states)."""
    worst = np.abs(values - truth).max(axis=0)
    return float((worst / np.abs(truth).max(axis=0)).max())


def truth_of(name: str, made: _core.Machine) -> Array:
    """What errors are measured against, shape (times, states)."""
    return np.asarray(run(name, made, "explicit", FINEST).values)


def affine_ms(name: str, rounds: int) -> float:
    """The machine without any law that is not affine, ms."""
    plain = partial(run, name, machine(name), "auto", RTOLS[0])
    return min(timed(plain)[0] for _ in range(10 * rounds))


def rows(name: str, law: str, rtols: list[float], rounds: int, affine: float) -> list[list[str]]:
    made = machine(name, law)
    truth = truth_of(name, made)
    agreement = error(np.asarray(run(name, made, "BDF", FINEST).values), truth)
    best: dict[tuple[float, str], float] = {}
    last: dict[tuple[float, str], _core.Trajectory] = {}
    for _ in range(rounds):
        for rtol, engine in product(rtols, ENGINES):
            ms, last[rtol, engine] = timed(partial(run, name, made, engine, rtol))
            best[rtol, engine] = min(ms, best.get((rtol, engine), np.inf))
    out = []
    for rtol in rtols:
        cells = [law, f"{rtol:.0e}", str(len(last[rtol, "auto"].events))]
        for engine in ENGINES:
            found = error(np.asarray(last[rtol, engine].values), truth)
            cells.append(f"{best[rtol, engine]:.1f} ({found:.0e})")
        fastest = min(best[rtol, engine] for engine in ENGINES if engine != "auto")
        auto = best[rtol, "auto"]
        cells += [f"{auto / fastest:.2f}", f"{auto / affine:.1f}"]
        out.append([*cells, last[rtol, "auto"].statistics["method"], f"{agreement:.0e}"])
    return out


def text(name: str, laws: list[str], rtols: list[float], rounds: int) -> str:
    affine = affine_ms(name, rounds)
    head = ["law", "rtol", "switches", *ENGINES, "ratio", "affine", "auto takes", "agreement"]
    found = [row for law in laws for row in rows(name, law, rtols, rounds, affine)]
    alone = f"{name} alone, exact engine: {affine:.2f} ms. Below: ms, and in brackets the error."
    return f"{alone}\n\n{report.table(head, found)}"


def main() -> None:
    parser = page.command_line(str(__doc__))
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--rtols", type=float, nargs="+", default=list(RTOLS))
    parser.add_argument("--machine", nargs="+", choices=list(MACHINES), default=list(MACHINES))
    parser.add_argument("--only", nargs="+", choices=LAWS, default=LAWS)
    given = page.told(parser, "machine", "only")
    print(report.surroundings_text(surroundings.describe()), "\n")
    for name in given.machine:
        tables = text(name, given.only, given.rtols, given.rounds)
        print(tables, "\n", flush=True)
        if given.write:
            page.write(f"laws {name}", tables)


if __name__ == "__main__":
    main()
