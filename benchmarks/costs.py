"""What one run of the case costs in the exact engine, and what is asked of it besides."""

from __future__ import annotations

import numpy as np

import ours
from case import SPAN
from measure import ROUNDS, measure
from report import table

RUNS = {
    "eight states": "exact",
    "every signal": "all signals",
    "balance of energy": "energy",
    f"gradient by {len(ours.PARAMETERS)} parameters (adjoint)": "tape",
    f"sensitivities to {len(ours.PARAMETERS)} parameters (forward)": "forward",
}


def text(rounds: int = ROUNDS) -> str:
    """Milliseconds a run, and over that of the plain run, for each build of the inner loops."""
    loops = ours.inner_loops()
    jobs = [ours.exact(what, which, one) for what, which in RUNS.items() for one in loops]
    points = measure(jobs, rounds)
    ms = np.reshape([p.ms for p in points], (len(RUNS), len(loops)))
    notes = [p.note for p in points[:: len(loops)]]
    rows = []
    for what, costs, note in zip(RUNS, ms, notes, strict=True):
        cells = [f"{a:.2f} ({a / first:.3g}x)" for a, first in zip(costs, ms[0], strict=True)]
        rows.append((what, *(cells if not note else ["failed"] * len(loops))))
    failed = [f"{what}: {note}" for what, note in zip(RUNS, notes, strict=True) if note]
    head = (f"{SPAN:g} s, output each ms: ms with inner loops", *loops)
    return "\n\n".join([table(head, rows), *failed])
