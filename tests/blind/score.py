"""python -m tests.blind score DIR [--results RESULTS] [--json FILE] [--plot reliability.png]"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from tests.blind.generator import parts
from tests.blind.scoring import diagram, text
from tests.blind.scoring.figures import Judged, everything


def main(arguments: Sequence[str]) -> int:
    """Hold the results of a run against the truth."""
    parser = argparse.ArgumentParser(prog="tests.blind score", description=main.__doc__)
    parser.add_argument("folder", type=Path, help="as `generate` wrote it")
    parser.add_argument("--results", type=Path, help="DIR/results unless given")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--plot", type=Path, help="the reliability diagram, a PNG")
    told = parser.parse_args(arguments)
    figures = everything(judged(told.folder, told.results or told.folder / "results"))
    if told.json:
        told.json.write_text(json.dumps(figures, indent=1) + "\n")
    if told.plot:
        diagram.draw(figures["trust"]["reliability"], told.plot)
    print(text.page(figures), end="")
    return 0


def judged(folder: Path, results: Path) -> list[Judged]:
    """Every case that has a result, beside its truth."""
    truths = parts.truths(folder)
    made = []
    for path in sorted(results.glob("*.json")):
        row = json.loads(path.read_text())
        if row["case"] in truths:
            answer = row.get("diagnosis", {})
            made.append(Judged(truths[row["case"]], answer, row["seconds"], row.get("failed", "")))
    return made
