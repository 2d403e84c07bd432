"""What the tests of numbers alone say of machines of the blind suite, no law being sought.

    python -m tests.blind generate --part develop --from 130 --cases 60 -o DIR
    python benchmarks/numbers_alone.py DIR [--group empty drifted outside]

Of every case whose loop is known the data sheet's numbers are refitted. Where that leaves noise the
row has the number that would change most from piece to piece of the records, what that takes off
chi-squared and what it would have to, and what the machine loses without torques of unknown course.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from dualdrive import Machine
from dualdrive.compare import evened
from dualdrive.diagnose.closed_loop import nominal_unknowns
from dualdrive.diagnose.decision.sanity import enough_for
from dualdrive.diagnose.selection import lost_without, white
from dualdrive.diagnose.selection.base import refitted_base
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.innovations import GreyBox, predictable
from dualdrive.replay import core_of, records
from dualdrive.traces import read
from report import table

GROUPS = ("empty", "drifted", "outside")
HEAD = ["case", "hidden", "changes most", "takes", "enough", "pieces", "lost without torque"]


def row(case: Path, hidden: str) -> list[str]:
    """One case."""
    known = json.loads((case / "case.json").read_text())
    traces = {name: evened(read(case / name))[0] for name in known["records"]}
    core = core_of(Machine.load(case / known["machine"]))
    played = records(core, dict(sorted(traces.items())), settings=known.get("settings"))
    grey = GreyBox(core, predictable(core, played), nominal_unknowns(core, None))
    found = refitted_base(Estimator(core, grey), grey).everywhere
    if found is None or not white(found):
        return [case.name, hidden, "leaves more than noise", "", "", "", ""]
    told, lost = Uncertainty(grey).changing(found), lost_without(core, grey, found)
    enough = enough_for(told.numbers, grey.samples)
    figures = [f"{told.gain:.0f}", f"{enough:.0f}", f"{told.numbers + 1}", f"{lost:.3g}"]
    return [case.name, hidden, told.name, *figures]


def main() -> None:
    """Print the table, a row as it comes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="as `python -m tests.blind generate` wrote it")
    parser.add_argument("--group", nargs="+", default=GROUPS, choices=GROUPS)
    asked = parser.parse_args()
    rows = []
    for path in sorted((asked.folder / "truth").glob("*.json")):
        truth = json.loads(path.read_text())
        if truth["group"] not in asked.group or truth["loop"] != "known":
            continue
        names = [e["effect"] for e in truth["effects"]] or [f"nothing, {truth['group']}"]
        rows.append(row(asked.folder / "cases" / path.stem, ", ".join(names)))
        print("; ".join(rows[-1]), flush=True)
    print(table(HEAD, rows))


if __name__ == "__main__":
    main()
