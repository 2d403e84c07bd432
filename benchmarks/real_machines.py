"""What `improve` makes of records of real machines: each one's ladder, and what their clocks part.

    python benchmarks/real_machines.py              all of them
    python benchmarks/real_machines.py emps kuka_b

The records lie beside the project, or where DUALDRIVE_DATA says; where they come from, and what is
published of these machines, stands in docs/howto/real-data.md.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Mapping
from pathlib import Path

from dualdrive import Machine
from dualdrive.compare import skews
from dualdrive.diagnose import improve
from dualdrive.traces import Trace, read, read_parts
from report import table
from surroundings import ROOT

DATA = Path(os.environ.get("DUALDRIVE_DATA", ROOT.parent / "shared" / "data"))
EXAMPLES = ROOT / "examples"
#: name -> record, machine and mapping among the examples
MACHINES = {
    "emps": ("emps/DATA_EMPS.mat", "emps", "emps"),
    "kuka_a": ("kuka_kr300/derived_rec_A.csv", "kuka", "kuka_axis1"),
    "kuka_b": ("kuka_kr300/derived_rec_B.csv", "kuka", "kuka_axis1"),
    "rig_log10": ("dual_motor_rig/log10.csv", "dual_motor_rig", "dual_motor_rig"),
    "rig_log12": ("dual_motor_rig/log12.csv", "dual_motor_rig", "dual_motor_rig"),
}
ARCSEC = math.pi / 180.0 / 3600.0


def records(name: str) -> Mapping[str, Trace]:
    """The parts of one log."""
    path, _, mapping = MACHINES[name]
    columns = EXAMPLES / f"{mapping}.map.toml"
    if mapping == "dual_motor_rig":
        parts = read_parts(DATA / path, columns)
        return {f"{name}, part {k}": part for k, part in enumerate(parts, 1)}
    return {name: read(DATA / path, columns)}


def clocks(machine: Machine, traces: Mapping[str, Trace]) -> str:
    """Which encoder is late, in each record where that can be told."""
    rows = [
        [
            s.record,
            f"{s.late} behind {s.early}",
            f"{1e3 * s.seconds:.3g} ({1e3 * s.low:.3g} to {1e3 * s.high:.3g}) ms",
            f"{s.apart / ARCSEC:.4g} arcsec",
            f"{s.left / ARCSEC:.4g} arcsec" if s.left < s.apart else "play hides it",
        ]
        for s in skews(machine, traces)
        if s.significant and math.isfinite(s.apart)
    ]
    head = ["record", "late", "by", "they part by", "put right"]
    return table(head, rows) if rows else "no encoder is late"


def main() -> None:
    """Print a ladder for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", nargs="*", choices=[[], *MACHINES], help="which; all unless given")
    asked = parser.parse_args()
    if not DATA.exists():
        parser.exit(1, f"no records in {DATA}; DUALDRIVE_DATA names the folder of measured data\n")
    for name in asked.name or MACHINES:
        machine, traces = Machine.load(EXAMPLES / f"{MACHINES[name][1]}.toml"), records(name)
        print(f"\n{name}\n\n{clocks(machine, traces)}\n", flush=True)
        cpu = time.process_time()
        ladder = improve(machine, traces, mode="balance", experiment=False)
        head, *rows = ladder.rows()
        print(table(head, rows))
        print(f"held out: {ladder.held}\nstopped: {ladder.stopped}")
        for found in ladder.diagnoses:
            print(found.paragraph)
        print(f"processor time {time.process_time() - cpu:.0f} s", flush=True)


if __name__ == "__main__":
    main()
