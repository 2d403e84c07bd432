"""python benchmarks/guesses.py [FOLDER]

What the three numbers decide by which a torque balance doubts the data sheet: the verdict on two
records of a robot axis with each of them at half, as it is, and at twice.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from dualdrive import Machine
from dualdrive.diagnose import diagnose
from dualdrive.estimation.thresholds import THRESHOLDS
from dualdrive.traces import read

HERE = Path(__file__).resolve().parents[1]
RECORDS = ("derived_rec_A.csv", "derived_rec_B.csv")
FACTORS = (0.5, 1.0, 2.0)


def verdict(record: Path) -> str:
    """What a balance of a robot axis says."""
    machine = Machine.load(HERE / "examples/kuka.toml")
    trace = read(record, HERE / "examples/kuka_axis1.map.toml")
    found = diagnose(machine, trace, mode="balance", experiment=False)
    named = found.candidates[0].label if found.verdict == "effect" else ""
    return f"{found.verdict} {named}".strip()


def main() -> None:
    """Print a table."""
    shared = HERE.parent / "shared/data/kuka_kr300"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else shared
    print("| number | record | half | as it is | twice |")
    print("|--------|--------|------|----------|-------|")
    for name in ("guessed", "strained", "cross_validated"):
        usual = THRESHOLDS[name]
        for record in RECORDS:
            cells = []
            for factor in FACTORS:
                THRESHOLDS[name] = replace(usual, value=factor * usual.value)
                cells.append(verdict(folder / record))
            print(f"| {name} | {record} | {' | '.join(cells)} |", flush=True)
        THRESHOLDS[name] = usual


if __name__ == "__main__":
    main()
