"""Derivatives of the case with many impacts, against differences of runs in long double.

    python benchmarks/gradients.py            a few seconds
    python benchmarks/gradients.py --write    and the table into docs/performance.md

The cost is the sum of squares of the eight states of Eq. 23, each over its own peak. Central
differences of it, in long double, know nothing of any derivative. As a contact moves past an output
time the cost has a kink, and the shorter the step the more rounding counts: of three steps the one
nearest to the derivative is taken. Times stand in the table of costs (benchmarks/run.py).
"""

from __future__ import annotations

import argparse

import numpy as np

import case
import page
from case import Array
from ours import OPTIONS, PARAMETERS
from report import table

STEPS = (1e-5, 1e-6, 1e-7)  # of a parameter
LIMIT = 1e-6


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


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"into {page.PAGE.name}")
    options = parser.parse_args()
    content = text(rows())
    print(content)
    if options.write:
        page.write("gradients", content)


if __name__ == "__main__":
    main()
