"""Error against work, three machines whose laws are not affine: a work-precision diagram.

    python benchmarks/work_precision.py               tables, and build/work-precision.svg
    python benchmarks/work_precision.py --write       table and picture into docs/

After E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.10. Every
engine and the peers of law_peers.py at tolerances of 1e-4 to 1e-11; machines, motion and errors are
those of laws.py. Work is processor time over that of the machine without its law, in the exact
engine; evaluations are those of the rates, as each engine counts them, Jacobians by differences
included. Adams and BDF of a peer may gain on those of an engine by having their law alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import law_peers
import laws
import page
import pictures
import report
import surroundings
from measure import Point

#: title -> machine and law of laws.py
CASES = {
    "Stribeck, bench": ("bench", "stribeck"),
    "torque ripple, heavy-table-550t": ("heavy-table-550t", "torque_ripple"),
    "LuGre, bench": ("bench", "lugre"),
}


@dataclass(frozen=True)
class Diagram:
    """One machine with its law; ms of the points over `affine` are the work."""

    title: str
    affine: float  # ms
    points: list[Point]
    missing: list[str]


def measured(title: str, rounds: int) -> Diagram:
    work = law_peers.Work(*CASES[title])
    ways, missing = work.ways()
    points = law_peers.points(work, ways, law_peers.RTOLS, rounds)
    return Diagram(title, laws.affine_ms(work.machine, rounds), points, missing)


def text(diagram: Diagram) -> str:
    head = ["engine", "rtol", "ms", "work", "evaluations", "switches", "error"]
    rows = (
        [p.engine, f"{p.rtol:.0e}", f"{p.ms:.1f}", f"{p.ms / diagram.affine:.1f}",
         str(p.evaluations), str(p.events), f"{p.error:.1e}"]
        if np.isfinite(p.error)
        else [p.engine, f"{p.rtol:.0e}", *["-"] * 4, p.note]
        for p in diagram.points
    )  # fmt: skip
    left_out = [f"Left out: {what}." for what in diagram.missing]
    alone = f"{diagram.title}; without the law, exact engine: {diagram.affine:.2f} ms."
    return "\n\n".join([alone, report.table(head, rows), *left_out])


def summary(diagrams: Sequence[Diagram]) -> str:
    """Work at two errors, by engine."""
    targets = (law_peers.TARGET, 1e-8)
    head = ["work", *(f"{d.title}: {t:.0e}" for d in diagrams for t in targets)]
    names = dict.fromkeys(p.engine for d in diagrams for p in d.points)

    def cell(d: Diagram, name: str, target: float) -> str:
        ms = law_peers.at_error(d.points, target, name)
        return f"{ms / d.affine:.1f}" if np.isfinite(ms) else "-"

    return report.table(
        head, ([name, *(cell(d, name, t) for d in diagrams for t in targets)] for name in names)
    )


def main() -> None:
    parser = page.command_line(str(__doc__))
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    print(report.surroundings_text(surroundings.describe()), "\n")
    diagrams = []
    for title in CASES:
        diagrams.append(measured(title, given.rounds))
        print(text(diagrams[-1]), "\n", flush=True)
    print(summary(diagrams))
    folder = page.PAGE.parent if given.write else surroundings.ROOT / "build"
    picture = pictures.work_precision({d.title: (d.affine, d.points) for d in diagrams})
    picture.savefig(folder / "work-precision.svg")
    picture.savefig(surroundings.ROOT / "build" / "work-precision.png")
    if given.write:
        page.write("work-precision", summary(diagrams))


if __name__ == "__main__":
    main()
