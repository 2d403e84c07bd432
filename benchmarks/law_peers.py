"""What a law that is not affine costs at an error of 1e-6, beside the same equations in peers.

    python benchmarks/law_peers.py                      every law that the peers have
    python benchmarks/law_peers.py --machine bench --only stribeck lugre
    python benchmarks/law_peers.py --write              into docs/performance.md as well

Machines, motion and errors are those of laws.py. Every engine runs at tolerances of 1e-4 to 1e-11;
a time is that at an error of 1e-6, reached and not asked for, by measure.at_equal_error. The peers
have the equations of cascade.py: DOP853 in Numba, and CVODE alone in C++ by the better of Adams and
BDF, both with modes frozen and their ends located. `ratio` is a peer's time to that of `auto`. What
peers can't have, a play in the gearboxes, they are left out of.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import cascade
import dop853
import laws
import page
import plain
import report
import surroundings
from case import Array
from effects import ENGINES, timed
from measure import Absent, Point, at_equal_error, in_turn

from dualdrive import _core  # isort: skip  (case.py finds the tests' folder)

RTOLS = tuple(10.0**-k for k in range(4, 12))
TARGET = 1e-6
COARSE = 1e-4  # of the run whose peaks tell the usual sizes of the peers' states
DOP853, ADAMS, BDF = "DOP853 in Numba", f"{plain.OPTIMISED} Adams", f"{plain.OPTIMISED} BDF"
MACHINES = [name for name in laws.MACHINES if name != "heavy-table-dual-servo"]
#: times the affine run that are asked for
MOST = 3.0
MOST_OF = dict.fromkeys(("stribeck", "lugre", "hertzian_stiffness"), 6.0)
#: rtol -> states of effects.STATES at every time, switches, evaluations of the rates
Way = Callable[[float], tuple[Array, int, int]]


@dataclass(frozen=True)
class Work:
    """A machine of laws.py with one law, and every way to run it."""

    machine: str
    law: str

    def made(self) -> _core.Machine:
        return laws.machine(self.machine, self.law)

    def ways(self) -> tuple[dict[str, Way], list[str]]:
        """By name; and what is left out, with the reason."""
        found: dict[str, Way] = {engine: self.ours(engine) for engine in ENGINES}
        missing = []
        try:
            found |= self.peers()
        except (ImportError, Absent) as absent:
            missing.append(f"peers ({absent})")
        return found, missing

    def ours(self, engine: str) -> Way:
        made = self.made()

        def run(rtol: float) -> tuple[Array, int, int]:
            raw = laws.run(self.machine, made, engine, rtol)
            return np.asarray(raw.values), len(raw.events), int(raw.statistics["rhs"])

        return run

    def peers(self) -> dict[str, Way]:
        """Raises ImportError without Numba, Absent without what CVODE needs."""
        sine = laws.MACHINES[self.machine]
        problem = cascade.problem(self.made(), sine.amplitude, sine.frequency)
        times = np.linspace(0.0, laws.SPAN, round(1e3 * laws.SPAN) + 1)
        by_numba = dop853.integrator(problem)
        start, _, _ = by_numba(COARSE, np.full(problem.states, laws.FINEST), times)
        sizes = np.maximum(np.abs(start).max(axis=0), laws.FINEST)

        def way(do: Any) -> Way:
            def run(rtol: float) -> tuple[Array, int, int]:
                y, switches, evaluations = do(rtol, rtol * sizes, times)
                return cascade.shown(y), switches, evaluations

            return run

        by_cvode = {
            ADAMS: plain.integrator(problem, "adams"),
            BDF: plain.integrator(problem, "bdf"),
        }
        return {name: way(do) for name, do in ({DOP853: by_numba} | by_cvode).items()}


def points(work: Work, ways: dict[str, Way], rtols: Sequence[float], rounds: int) -> list[Point]:
    """Every way at every tolerance."""
    truth = laws.truth_of(work.machine, work.made())

    def run(name: str, rtol: float) -> tuple[float, float, int, int]:
        ms, (values, events, evaluations) = timed(lambda: ways[name](rtol))
        return ms, laws.error(values, truth), events, evaluations

    return in_turn(ways, rtols, rounds, run)


def at_error(found: Sequence[Point], target: float, *names: str) -> float:
    """The time of the best of these, ms; infinite where none comes to the error."""
    of_each = (at_equal_error([p for p in found if p.engine == name], target) for name in names)
    return min((ms for ms in of_each if ms is not None), default=np.inf)


def row(work: Work, rounds: int, affine: float) -> tuple[list[str], list[str]]:
    ways, missing = work.ways()
    found = points(work, ways, RTOLS, rounds)
    auto = at_error(found, TARGET, "auto")
    most = MOST_OF.get(work.law, MOST)
    cells = [work.law, f"{auto:.1f}", f"{auto / affine:.1f}", f"≤ {most:g}"]
    cells.append("met" if auto <= most * affine else "not met")
    for names in (("Adams", "BDF"), (DOP853,), (ADAMS, BDF)):
        ms = at_error(found, TARGET, *names)
        cells.append(f"{ms / auto:.1f} ({ms:.1f})" if np.isfinite(ms) else "-")
    return cells, missing


HEAD = ["law", "auto, ms", "to affine", "asked", "", "engine cvode: ratio (ms)",
        f"{DOP853}: ratio (ms)", f"{plain.OPTIMISED}: ratio (ms)"]  # fmt: skip


def texts(name: str, asked: Sequence[str], rounds: int) -> Iterator[str]:
    affine = laws.affine_ms(name, rounds)
    found, missing = [], set()
    for law in asked:
        cells, absent = row(Work(name, law), rounds, affine)
        print(name, *cells, sep="; ", file=sys.stderr, flush=True)  # long before the end
        found.append(cells)
        missing |= set(absent)
    yield f"{name} alone, exact engine: {affine:.2f} ms. Below at an error of {TARGET:.0e}."
    yield report.table(HEAD, found)
    yield from (f"Left out: {what}." for what in sorted(missing))


def main() -> None:
    parser = page.command_line(str(__doc__))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--machine", nargs="+", choices=MACHINES, default=MACHINES)
    parser.add_argument("--only", nargs="+", choices=cascade.LAWS, default=cascade.LAWS)
    given = page.told(parser, "machine", "only")
    print(report.surroundings_text(surroundings.describe()), "\n")
    tables = []
    for name in given.machine:
        tables.append("\n\n".join(texts(name, given.only, given.rounds)))
        print(tables[-1], "\n", flush=True)
    if given.write:
        page.write("law peers", "\n\n".join(tables))


if __name__ == "__main__":
    main()
