"""Derivatives of the case with many impacts, against differences of runs in long double.

    python benchmarks/gradients.py            a minute or two
    python benchmarks/gradients.py --write    and the tables into docs/performance.md

The cost is the sum of squares of the eight states of Eq. 23, each over its own peak. Central
differences of it, in long double, know nothing of any derivative. As a contact moves past an output
time the cost has a kink, and the shorter the step the more rounding counts: of three steps the one
nearest to the derivative is taken. Times stand in the table of costs (benchmarks/run.py).

Then the same with laws that are not affine, ripple of both motors and Stribeck friction of the
table, which long double has no engine for: against forward sensitivities of the explicit engine and
against differences of its runs, both at rtol 1e-13. Times are processor time, the best of several
rounds.
"""

from __future__ import annotations

import argparse
from functools import partial

import numpy as np

import case
import page
from case import Array
from effects import timed
from ours import OPTIONS, PARAMETERS
from report import table

STEPS = (1e-5, 1e-6, 1e-7)  # of a parameter
LIMIT = 1e-6

RIPPLE = {"amplitude": 0.01, "order": 24.0}
STRIBECK = {"torque": 200.0, "static_ratio": 1.3, "speed": 2e-3}
MOTORS = ("motor_1", "motor_2")
LAWS = [
    *(f"torque_ripple@{motor}.{name}" for motor in MOTORS for name in RIPPLE),
    *(f"stribeck@table.{name}" for name in STRIBECK),
]
NUMBERS = [*LAWS, *(path for path in PARAMETERS if not path.endswith((".L", ".b", "_2.J", "_2.R")))]
STEPS_IN_DOUBLE = (1e-4, 1e-5, 1e-6)  # runs in double have more rounding
FINEST = 1e-13
RTOLS = (1e-6, 1e-8, 1e-10)
MOST_RUNS = 3.0


def weights() -> Array:
    """One over the peak of each state, shape (8,)."""
    return 1.0 / np.abs(case.simulate(engine="exact").raw.values).max(axis=0)


def backward(weight: Array) -> Array:
    """By the adjoint, times each parameter: shape (parameters,)."""
    run = case.simulate(**OPTIONS["tape"]).raw
    return run.pull_back(2.0 * weight**2 * run.values) * nominal()


def forward(weight: Array) -> Array:
    """From forward sensitivities, times each parameter: shape (parameters,)."""
    run = case.simulate(**OPTIONS["forward"]).raw
    slopes = np.einsum("ts,tsp->p", 2.0 * weight**2 * run.values, run.sensitivities)
    return slopes * nominal()


def nominal() -> Array:
    machine, _ = case.core()
    return np.array([machine.get(path) for path in PARAMETERS])


def cost(weight: Array, path: str, share: float) -> np.longdouble:
    """Of a run in long double, one parameter changed by a share of itself."""
    machine, inputs = case.core()
    changed = machine.copy()
    changed.set(path, machine.get(path) * (1.0 + share))
    run = case._core.simulate(changed, inputs, end=case.SPAN, signals=case.PLANT, energy=False,
                              engine="exact", long_double=True)  # fmt: skip
    return np.sum((weight * run.values).astype(np.longdouble) ** 2)


def difference(weight: Array, path: str, step: float) -> float:
    up, down = (cost(weight, path, sign * step) for sign in (1, -1))
    return float((up - down) / (2.0 * step))


def rows() -> list[tuple[str, float, float, float]]:
    """Parameter; derivative times parameter; what forward and backward are off by, over it."""
    weight = weights()
    found = []
    for path, ahead, back in zip(PARAMETERS, forward(weight), backward(weight), strict=True):
        tries = [difference(weight, path, step) for step in STEPS]
        off = [min(abs(value - one) for one in tries) / abs(back) for value in (ahead, back)]
        found.append((path, float(back), *off))
        print(f"{path:20} {back:12.5g} {off[0]:8.1e} {off[1]:8.1e}", flush=True)
    return found


def text(found: list[tuple[str, float, float, float]]) -> str:
    worst = max(max(ahead, back) for _, _, ahead, back in found)
    verdict = "met" if worst <= LIMIT else "not met"
    cells = [(path, f"{slope:.5g}", f"{a:.1e}", f"{b:.1e}") for path, slope, a, b in found]
    head = ("parameter", "dJ/dp p", "forward off by", "adjoint off by")
    return f"Worst {worst:.1e}; asked for ≤ {LIMIT:g}: {verdict}.\n\n{table(head, cells)}"


# ---------------------------------------------------------------------- laws that are not affine


def with_laws() -> case._core.Machine:
    machine = case.core()[0].copy()
    laws = [("torque_ripple", motor, RIPPLE) for motor in MOTORS]
    for law, place, values in [*laws, ("stribeck", "table", STRIBECK)]:
        case.core_machines.set_all(machine, machine.add_effect(law, place), values)
    return machine


def run(machine: case._core.Machine, **options: object) -> case._core.Trajectory:
    given = {"end": case.SPAN, "signals": case.PLANT, "energy": False} | options
    raw = case._core.simulate(machine, case.core()[1], **given)  # type: ignore[arg-type]
    if raw.status != "success":
        raise RuntimeError(raw.message)
    return raw


def runs_of_a_gradient(rounds: int = 5) -> list[list[str]]:
    """Tolerance; ms of a plain run, of one with its tape and of the way back; runs they make."""
    machine, found = with_laws(), []
    for rtol in RTOLS:
        best = np.full(3, np.inf)
        for _ in range(rounds):
            plain, _ = timed(partial(run, machine, rtol=rtol))
            taped, kept = timed(partial(run, machine, rtol=rtol, gradient=NUMBERS))
            back, _ = timed(partial(kept.pull_back, 2.0 * kept.values))
            best = np.minimum(best, (plain, taped, back))
        runs = float(best[1] + best[2]) / float(best[0])
        verdict = "met" if runs <= MOST_RUNS else "not met"
        found.append([f"{rtol:.0e}", *(f"{ms:.1f}" for ms in best), f"{runs:.2f}", verdict])
    return found


def rows_of_laws() -> list[tuple[str, float, float, float]]:
    """Parameter; derivative times parameter; what the adjoint is off by, over it."""
    machine = with_laws()
    size = np.array([machine.get(path) for path in NUMBERS])
    back = run(machine, gradient=NUMBERS)
    weight = 1.0 / np.abs(back.values).max(axis=0)
    gradient = back.pull_back(2.0 * weight**2 * back.values) * size
    fine = {"engine": "explicit", "rtol": FINEST}
    ahead = run(machine, sensitivities=NUMBERS, **fine)
    slopes = np.einsum("ts,tsp->p", 2.0 * weight**2 * ahead.values, ahead.sensitivities) * size

    def cost_of(path: str, share: float) -> np.longdouble:
        changed = machine.copy()
        changed.set(path, machine.get(path) * (1.0 + share))
        return np.sum((weight * run(changed, **fine).values).astype(np.longdouble) ** 2)

    found = []
    for path, by_back, by_slopes in zip(NUMBERS, gradient, slopes, strict=True):
        tries = [float((cost_of(path, h) - cost_of(path, -h)) / (2.0 * h)) for h in STEPS_IN_DOUBLE]
        off = [abs(by_slopes - by_back), min(abs(one - by_back) for one in tries)]
        found.append((path, float(by_back), *(float(x / abs(by_back)) for x in off)))
        print(f"{path:32} {by_back:12.5g} {found[-1][2]:8.1e} {found[-1][3]:8.1e}", flush=True)
    return found


def text_of_laws() -> str:
    wanted = ("rtol", "plain run, ms", "with its tape", "way back", "runs", f"≤ {MOST_RUNS:g}")
    costs = table(wanted, runs_of_a_gradient())
    found = rows_of_laws()
    worst = [max(row[k] for row in found) for k in (2, 3)]
    verdict = "met" if worst[0] <= LIMIT else "not met"
    cells = [(path, f"{slope:.5g}", f"{a:.1e}", f"{b:.1e}") for path, slope, a, b in found]
    head = ("parameter", "dJ/dp p", "off forward slopes by", "off differences by")
    line = (f"Ripple of both motors and Stribeck friction besides, {len(NUMBERS)} numbers. Worst "
            f"{worst[0]:.1e} off forward slopes; asked for ≤ {LIMIT:g}: {verdict}. Worst "
            f"{worst[1]:.1e} off differences of runs in double.")  # fmt: skip
    return f"{line}\n\n{costs}\n\n{table(head, cells)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"into {page.PAGE.name}")
    options = parser.parse_args()
    parts = {"gradients": text(rows()), "gradients of laws": text_of_laws()}
    print("\n\n".join(parts.values()))
    if options.write:
        for name, content in parts.items():
            page.write(name, content)


if __name__ == "__main__":
    main()
