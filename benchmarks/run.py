"""How fast dualdrive is, beside other people's solvers, at the error that is reached.

    python benchmarks/run.py                    everything: about six minutes
    python benchmarks/run.py --quick            what matters most: within a minute
    python benchmarks/run.py --only engines     one part; repeat for more
    python benchmarks/run.py --write            tables and pictures into docs/

Prints tables; writes build/benchmark.json and pictures beside it. Peers that are not installed are
left out and named: pip install -e '.[bench]' gets them, ./dev build the optimised SUNDIALS, apt-get
install libsundials-dev Debian's. Times are processor time of the best repeat, engines taking turns,
so that other work on the machine disturbs them little.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import case
import costs
import linear
import ours
import page
import pictures
import report
import surroundings
from measure import ROUNDS, RTOLS, Absent, Engine, Program, measure

PARTS = ("engines", "costs", "linear", "presets")
QUICK = PARTS[:3]
BUILD = surroundings.ROOT / "build"
DOCS = surroundings.ROOT / "docs"


def main() -> None:
    parser = page.command_line(str(__doc__))
    parser.add_argument("--quick", action="store_true", help="fewer engines, rounds, seconds")
    parser.add_argument("--only", choices=PARTS, action="append", help="a part; repeat for more")
    given = parser.parse_args()

    facts = surroundings.describe()
    texts = {"surroundings": report.surroundings_text(facts)}
    print(texts["surroundings"])
    result: dict[str, Any] = {"surroundings": facts}
    folder = DOCS if given.write else BUILD
    folder.mkdir(exist_ok=True)
    for part in given.only or (QUICK if given.quick else PARTS):
        found, written = DO[part](given.quick, folder)
        result[part] = found
        texts |= written
        print("\n\n".join(["", *written.values()]))
    BUILD.mkdir(exist_ok=True)
    path = BUILD / "benchmark.json"
    path.write_text(json.dumps(case.plain(result), indent=2) + "\n", "utf-8")
    print(f"\nwritten: {path}")
    if given.write:
        for name, text in texts.items():
            page.write(name, text)
        print(f"written: {page.PAGE}")


Part = tuple[Any, dict[str, str]]  # for the JSON file; texts by the name of their place on the page


def engines(quick: bool, folder: Path) -> Part:
    found, missing = available(quick)
    points = measure(found, 2 if quick else ROUNDS)
    figures = report.wanted(points)
    pictures.accuracy_against_work(points).savefig(folder / "performance-engines.svg")
    truth = (
        f"{len(case.truth().contacts)} contacts made or lost. The independent solution of "
        f"tests/py/reference_model.py, in double, comes within {case.agreement():.1e} of the "
        f"reference; a shift of the start by 1e-12 of the gap grows to {case.spread():.1e}."
    )
    left_out = [f"Left out: {what}." for what in missing]
    return (
        {"points": [asdict(p) for p in points], "figures": [asdict(f) for f in figures],
         "missing": missing},
        {"points": "\n\n".join([truth, report.points_text(points), *left_out]),
         "equal-error": report.equal_error_text(points),
         "wanted": report.wanted_text(figures)},
    )  # fmt: skip


def available(quick: bool) -> tuple[list[Engine | Program], list[str]]:
    """Every engine that can run here, and why others can't."""
    import dop853
    import peers
    import plain

    makers: dict[str, Callable[[], Sequence[Engine | Program]]] = {
        "dualdrive": ours.engines,
        plain.OPTIMISED: lambda: plain.engines(
            plain.OPTIMISED, adams=RTOLS, bdf=(*RTOLS[::2], RTOLS[-1])
        ),
        plain.DEBIAN: lambda: plain.engines(plain.DEBIAN, adams=RTOLS[1::2]),
        dop853.NAME: dop853.engines,
        "SciPy with Numba": peers.scipy_engines,
        "scikit-sundae with Numba": peers.sundae_engines,
        "CasADi": peers.casadi_engines,
    }
    found: list[Engine | Program] = []
    missing = []
    for name, make in makers.items():
        try:
            found += make()
        except (ImportError, Absent) as absent:
            missing.append(f"{name} ({absent})")
    return (thinned(found) if quick else found), missing


def thinned(engines: Sequence[Engine | Program]) -> list[Engine | Program]:
    """Without what is slow, and every second tolerance of the rest."""
    slow = ("BDF", "Radau", "SciPy DOP853")
    fast = [one for one in engines if not any(word in one.name for word in slow)]
    return [replace(one, rtols=one.rtols[::2]) for one in fast]


def what_a_run_costs(quick: bool, folder: Path) -> Part:
    text = costs.text(2 if quick else ROUNDS)
    return text.splitlines(), {"costs": text}


def lines(quick: bool, folder: Path) -> Part:
    found = linear.measure(quick=quick)
    linear.draw(found).savefig(folder / "performance-linear.svg")
    return asdict(found), {"linear": found.text()}


def preset_runs(quick: bool, folder: Path) -> Part:
    rows = ours.preset_rows()
    return rows, {"presets": report.presets_text(rows)}


DO: dict[str, Callable[[bool, Path], Part]] = {
    "engines": engines,
    "costs": what_a_run_costs,
    "linear": lines,
    "presets": preset_runs,
}

if __name__ == "__main__":
    main()
