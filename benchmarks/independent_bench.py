"""What `diagnose` says of the eight cases of an independent bench, and what it takes.

    python benchmarks/independent_bench.py                        all, whole records
    python benchmarks/independent_bench.py ripple_both --seconds 4

Another program made the records; they lie beside the project, or where DUALDRIVE_DATA says. The
truth stands in their README.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from dualdrive import Machine
from dualdrive.diagnose import Diagnosis, diagnose
from dualdrive.traces import read
from report import table
from surroundings import ROOT

DATA = Path(os.environ.get("DUALDRIVE_DATA", ROOT.parent / "shared" / "data")) / "independent_bench"
#: case -> what is hidden
HIDDEN = {
    "null_drift_b": "nothing, numbers off",
    "coulomb_table": "coulomb@table",
    "ripple_both": "torque_ripple@motors",
    "two_fric_ecc": "coulomb@table, eccentricity@table",
    "encoder_skew": "sensor_delay@theta_m",
    "compliance": "shaft_compliance@gearboxes",
    "gearbox_play": "gearbox_backlash@gearboxes",
    "out_boucwen": "no law of the library",
}
#: record -> what was set for it
SLACK = {"slack": {"controller.T_ten": 0.0}}
HEAD = [
    "case",
    "hidden",
    "verdict",
    "named",
    "sizes",
    "refitted",
    "with it",
    "cross-val.",
    "floor",
    "wall",
    "CPU",
]


def told(found: Diagnosis) -> tuple[str, list[str]]:
    """What a diagnosis names, and its errors: refitted, with it, cross-validated, floor."""
    named = (
        found.candidates[0].label
        if found.verdict == "effect"
        else ", ".join(found.groups[0] if found.groups else ())
    )
    keys = ("refitted", "best", "held_out_best", "noise_floor")
    return named, [f"{100 * found.error[key]:.3g} %" for key in keys]


def row(case: str, seconds: float | None, effort: str) -> list[str]:
    """One case diagnosed."""
    traces = {p.stem: read(p) for p in sorted((DATA / case).glob("*.csv"))}
    if seconds is not None:
        traces = {name: trace.between(0.0, seconds) for name, trace in traces.items()}
    wall, cpu = time.perf_counter(), time.process_time()
    found = diagnose(
        Machine.load(DATA / "nominal.toml"),
        traces,
        settings=SLACK,
        effort=effort,
        experiment=False,
    )
    took = [f"{time.perf_counter() - wall:.0f} s", f"{time.process_time() - cpu:.0f} s"]
    named, errors = told(found)
    known = found.candidates[0].parameters if named else {}
    sizes = ", ".join(f"{p.value:.3g} {p.unit}".strip() for p in known.values())
    return [case, HIDDEN[case], found.verdict, named, sizes, *errors, *took]


def main() -> None:
    """Print the table, a row as it comes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", nargs="*", choices=[[], *HIDDEN], help="which; all unless given")
    parser.add_argument("--seconds", type=float, help="of every record; all of it")
    parser.add_argument("--effort", default="normal", choices=["quick", "normal", "thorough"])
    asked = parser.parse_args()
    if not DATA.exists():
        parser.exit(1, f"no records in {DATA}; DUALDRIVE_DATA names the folder of measured data\n")
    rows = []
    for case in asked.case or HIDDEN:
        rows.append(row(case, asked.seconds, asked.effort))
        print("; ".join(rows[-1]), flush=True)
    print(table(HEAD, rows))


if __name__ == "__main__":
    main()
