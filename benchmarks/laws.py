"""What one law that is not affine costs on the bench, and whether `auto` takes the best engine.

    python benchmarks/laws.py                   every law, at rtol 1e-6 and at the default
    python benchmarks/laws.py --rtols 1e-6      at one tolerance
    python benchmarks/laws.py --only stribeck lugre
    python benchmarks/laws.py --write           into docs/performance.md as well

The bench with its current loops at 2500 1/s, ten seconds of a sine, states recorded at 1 kHz; each
effect at a size that is usual there. Errors are those of the worst state over its own peak, against
the explicit engine at rtol 1e-12 (`agreement`: how near BDF comes to it). Times are processor time,
the best of several rounds in which the engines take turns; `ratio` is that of `auto` to the fastest
engine at the same tolerance, `affine` that of `auto` to the bench without the effect.
"""

from __future__ import annotations

import argparse
from functools import partial
from itertools import product

import numpy as np

import page
import report
import surroundings
from case import Array
from effects import ENGINES, STATES, timed

import core_machines  # isort: skip  (case.py finds the tests' folder)
from case import reference
from dualdrive import _core
from usual_laws import LAWS

SPAN = 10.0  # s
RTOLS = (1e-6, 1e-10)
FINEST = 1e-12
MOST_STEPS = 3_000_000
AMPLITUDE, FREQUENCY = 0.3, 0.5  # rad, Hz; the motors reach 38 rad/s
OMEGA_CI = 2500.0  # 1/s


def bench(law: str = "") -> _core.Machine:
    machine = core_machines.core_machine(reference.bench().control(omega_ci=OMEGA_CI))
    machine.set("motors.T_rated", 1.27)
    places, values = LAWS.get(law, ((), {}))
    for place in places:
        core_machines.set_all(machine, machine.add_effect(law, place), values)
    return machine


def run(machine: _core.Machine, engine: str, rtol: float) -> _core.Trajectory:
    inputs = core_machines.core_inputs(reference.sine(AMPLITUDE, FREQUENCY))
    raw = _core.simulate(machine, inputs, end=SPAN, rtol=rtol, signals=STATES, energy=False,
                         max_steps=MOST_STEPS, **ENGINES[engine])  # fmt: skip
    if raw.status != "success":
        raise RuntimeError(f"{engine}, rtol {rtol:g}: {raw.message}")
    return raw


def error(raw: _core.Trajectory, truth: Array) -> float:
    worst = np.abs(np.asarray(raw.values) - truth).max(axis=0)
    return float((worst / np.abs(truth).max(axis=0)).max())


def affine_ms(rounds: int) -> float:
    plain = partial(run, bench(), "auto", RTOLS[0])
    return min(timed(plain)[0] for _ in range(10 * rounds))


def rows(law: str, rtols: list[float], rounds: int, affine: float) -> list[list[str]]:
    machine = bench(law)
    truth = np.asarray(run(machine, "explicit", FINEST).values)
    agreement = error(run(machine, "BDF", FINEST), truth)
    best: dict[tuple[float, str], float] = {}
    last: dict[tuple[float, str], _core.Trajectory] = {}
    for _ in range(rounds):
        for rtol, engine in product(rtols, ENGINES):
            ms, last[rtol, engine] = timed(partial(run, machine, engine, rtol))
            best[rtol, engine] = min(ms, best.get((rtol, engine), np.inf))
    out = []
    for rtol in rtols:
        cells = [law, f"{rtol:.0e}", str(len(last[rtol, "auto"].events))]
        for engine in ENGINES:
            found = error(last[rtol, engine], truth)
            cells.append(f"{best[rtol, engine]:.1f} ({found:.0e})")
        fastest = min(best[rtol, engine] for engine in ENGINES if engine != "auto")
        auto = best[rtol, "auto"]
        cells += [f"{auto / fastest:.2f}", f"{auto / affine:.1f}"]
        out.append([*cells, last[rtol, "auto"].statistics["method"], f"{agreement:.0e}"])
    return out


def text(laws: list[str], rtols: list[float], rounds: int) -> str:
    affine = affine_ms(rounds)
    head = ["law", "rtol", "switches", *ENGINES, "ratio", "affine", "auto takes", "agreement"]
    found = [row for law in laws for row in rows(law, rtols, rounds, affine)]
    alone = f"The bench alone, exact engine: {affine:.2f} ms. Below: ms, and in brackets the error."
    return f"{alone}\n\n{report.table(head, found)}"


def main() -> None:
    about, _, rest = str(__doc__).partition("\n\n")
    parser = argparse.ArgumentParser(
        description=about, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--rtols", type=float, nargs="+", default=list(RTOLS))
    parser.add_argument("--only", nargs="+", choices=list(LAWS), default=list(LAWS))
    parser.add_argument("--write", action="store_true", help=f"into {page.PAGE.name}")
    given = parser.parse_args()
    print(report.surroundings_text(surroundings.describe()), "\n")
    tables = text(given.only, given.rtols, given.rounds)
    print(tables)
    if given.write:
        page.write("laws", tables)


if __name__ == "__main__":
    main()
