"""How far `auto` is from the best of its engines, over random machines whose laws differ.

    python benchmarks/turns.py                  the random machines of the tests, numbers 0 to 399
    python benchmarks/turns.py --last 1000

Each machine with a law that is not affine runs by `auto`, `exponential`, `explicit` and BDF at one
tolerance, the best of two times each; a ratio is the processor time of `auto` to that of the
fastest other. BDF is given the same tolerance, at which it errs more than `auto` does (laws.py
shows errors).
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

import report
from effects import ENGINES, timed

import core_machines  # isort: skip  (case.py finds the tests' folder)
from core_random import RandomMachine
from dualdrive import _core

RTOL, END, MOST_STEPS, LOSERS = 1e-7, 1.5, 400_000, 10
TAKEN = ("auto", "exponential", "explicit", "BDF")
ROUNDS = 2
AFFINE = {kind.name: kind.affine for kind in _core.effect_types()}


def run(m: RandomMachine, engine: str) -> core_machines.Run:
    return core_machines.Run(
        _core.simulate(m.machine, m.inputs, end=END, initial=m.initial, rtol=RTOL, energy=False,
                       max_steps=MOST_STEPS, **ENGINES[engine])
    )  # fmt: skip


def measured(seed: int) -> tuple[float, list[str]] | None:
    """The ratio and a row that tells of it; None where there is nothing to choose or a run ends."""
    m = RandomMachine(seed)
    laws = [e["effect"] for e in m.machine.effects if not AFFINE.get(e["effect"], False)]
    if not laws:
        return None
    found: dict[str, tuple[float, Any]] = {
        e: min((timed(partial(run, m, e)) for _ in range(ROUNDS)), key=lambda timing: timing[0])
        for e in TAKEN
    }
    if found["auto"][1].raw.status != "success":
        return None
    best = min((ms for ms, r in list(found.values())[1:] if r.raw.status == "success"), default=0.0)
    if best == 0.0 or found["auto"][1].raw.statistics["method"] == "exact":
        return None
    ratio = found["auto"][0] / best
    times = [f"{ms:.1f}" if r.raw.status == "success" else "-" for ms, r in found.values()]
    return ratio, [str(seed), f"{ratio:.2f}", *times, ", ".join(laws)]


def main() -> None:
    last = report.count_asked(str(__doc__), "last", 400)
    found = sorted(filter(None, map(measured, range(last))), reverse=True)
    ratios = [ratio for ratio, _ in found]
    low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
    print(
        f"{len(ratios)} machines: {low:.2f} to {high:.2f} for nine in ten, median {middle:.2f}.\n"
    )
    head = ["machine", "ratio", *(f"{engine}, ms" for engine in TAKEN), "laws"]
    print(report.table(head, [row for _, row in found[:LOSERS]]))


if __name__ == "__main__":
    main()
