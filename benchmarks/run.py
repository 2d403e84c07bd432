"""How fast dualdrive is, beside other people's solvers, at the error that is reached.

    python benchmarks/run.py                    everything: about four minutes
    python benchmarks/run.py --quick            without SciPy's slow implicit methods
    python benchmarks/run.py --only presets     one part: engines, presets or throughput

Prints tables; writes OUTPUT.json and OUTPUT.png (-o OUTPUT, default build/benchmark). Peers that
are not installed are left out and named: pip install -e '.[bench]' gets them. Times are processor
time of the best repeat, so that other work on the machine disturbs them little; those of sweeps are
wall clock and need a quiet machine.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import case
import ours
import report
import surroundings

PARTS = ("engines", "presets", "throughput")


def main() -> None:
    about, _, rest = str(__doc__).partition("\n\n")
    parser = argparse.ArgumentParser(
        description=about, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, default=surroundings.ROOT / "build/benchmark")
    parser.add_argument("--quick", action="store_true", help="leave slow methods out")
    parser.add_argument("--only", choices=PARTS, action="append", help="a part; repeat for more")
    given = parser.parse_args()
    parts = given.only or PARTS

    result: dict[str, Any] = {"surroundings": surroundings.describe()}
    print(report.surroundings_text(result["surroundings"]))
    if "engines" in parts:
        points, missing = measure_engines(quick=given.quick)
        result["case"] = {"contacts": len(case.truth().contacts), "spread": case.spread()}
        result["engines"] = [asdict(point) for point in points]
        result["at_equal_error"] = report.equal_error(points)
        result["missing"] = missing
        print(report.engines_text(result, points))
    if "presets" in parts:
        result["presets"] = ours.preset_rows()
        print(report.presets_text(result["presets"]))
    if "throughput" in parts:
        result["throughput"] = ours.throughput(ours.cores())
        print(report.throughput_text(result["throughput"]))

    given.output.parent.mkdir(parents=True, exist_ok=True)
    page = given.output.with_suffix(".json")
    page.write_text(json.dumps(case.plain(result), indent=2) + "\n", "utf-8")
    written = [str(page)]
    if "engines" in result:
        picture = given.output.with_suffix(".png")
        report.draw(points, result["case"]["spread"]).savefig(picture)
        written.append(str(picture))
    print(f"\nwritten: {', '.join(written)}")


def measure_engines(*, quick: bool) -> tuple[list[case.Point], list[str]]:
    import peers

    points: list[case.Point] = []
    missing: list[str] = []
    makers: tuple[tuple[str, Callable[[], list[case.Engine]]], ...] = (
        ("dualdrive", ours.engines),
        ("SciPy with numba", lambda: peers.scipy_engines(slow=not quick)),
        ("scikit-sundae with numba", peers.sundae_engines),
    )
    for name, make in makers:
        try:
            engines = make()
        except ImportError as absent:
            missing.append(f"{name}: {absent}")
            continue
        for engine in engines:
            points += [engine.measure(rtol) for rtol in engine.rtols]
    return points, missing


if __name__ == "__main__":
    main()
