"""python -m tests.blind score --suite-folder DIR --results RESULTS [--json figures.json]"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from tests.blind.generator import suite
from tests.blind.scoring import text
from tests.blind.scoring.figures import Judged, everything


def main(arguments: Sequence[str]) -> int:
    """Hold the results of a run against the sealed labels."""
    parser = argparse.ArgumentParser(prog="tests.blind score", description=main.__doc__)
    parser.add_argument("--suite-folder", type=Path, required=True, help="where labels.jsonl lies")
    parser.add_argument("--results", type=Path, required=True, action="append")
    parser.add_argument("--json", type=Path)
    told = parser.parse_args(arguments)
    figures = everything(judged(told.suite_folder, told.results))
    if told.json:
        told.json.write_text(json.dumps(figures, indent=1) + "\n")
    print(text.page(figures), end="")
    return 0


def judged(folder: Path, results: Sequence[Path]) -> list[Judged]:
    """Every case that has a result, beside its label."""
    labels = suite.labels(folder)
    made = []
    for path in sorted(p for r in results for p in r.glob("case-*.json")):
        row = json.loads(path.read_text())
        answer = row.get("diagnosis", {})
        made.append(Judged(labels[row["case"]], answer, row["seconds"], row.get("failed", "")))
    return made
