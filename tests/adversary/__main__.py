"""python -m tests.adversary [--seed N] [--row NAME] [--every N] [--keep FOLDER]"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a fork of many threads is none

import argparse
import random
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from . import rows_command_line, rows_files, rows_words
from .attempt import Attempt, judge
from .inputs import make_inputs
from .warm import load_everything

#: kind of attempt -> what makes them
ROWS: Final[dict[str, Callable[[random.Random], Iterator[Attempt]]]] = {
    "options": rows_command_line.options,
    "numbers": rows_command_line.numbers,
    "arguments": rows_command_line.arguments,
    "outputs": rows_command_line.outputs,
    "places": rows_command_line.places,
    "memory": rows_command_line.memory,
    "interrupts": rows_command_line.interrupts,
    "early interrupts": rows_command_line.interrupts_early,
    "machine files": rows_files.machine_files,
    "broken text": rows_files.broken_text,
    "mappings": rows_files.mappings,
    "tables": rows_files.tables,
    "binaries": rows_files.binaries,
    "links": rows_files.links,
    "units": rows_words.units,
    "motions": rows_words.motions,
    "formulas": rows_words.formulas,
}


def main() -> int:
    """Make the attempts; 1 where one of them failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.adversary", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="another draw of the same kinds")
    parser.add_argument("--row", action="append", choices=ROWS, help="this kind only; repeatable")
    parser.add_argument("--every", type=int, default=1, help="every n-th attempt only")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    given = parser.parse_args()
    load_everything()
    failures = tried = 0
    with tempfile.TemporaryDirectory(prefix="adversary-") as name:
        folder = Path(name)
        inputs = folder / "inputs"
        inputs.mkdir()
        make_inputs(inputs)
        print(f"{'kind of attempt':<16} {'tried':>6} {'failed':>6}")
        for row in given.row or ROWS:
            # each row draws for itself, so that one alone is the same as among others
            chance = random.Random(f"{given.seed} {row}")
            attempts = list(ROWS[row](chance))[:: given.every]
            wrong = _make(attempts, inputs, folder, given.jobs)
            print(f"{row:<16} {len(attempts):>6} {len(wrong):>6}", flush=True)
            for what, why in wrong:
                print(f"    {what[:160]!s}\n        {why}", flush=True)
            tried, failures = tried + len(attempts), failures + len(wrong)
        print(f"{'all':<16} {tried:>6} {failures:>6}")
    return int(failures > 0)


def _make(attempts: list[Attempt], inputs: Path, folder: Path, jobs: int) -> list[tuple[str, str]]:
    """What failed, and why."""

    def one(item: tuple[int, Attempt]) -> tuple[str, str]:
        number, attempt = item
        return attempt.what, judge(
            attempt, inputs, folder / f"attempt-{number % (4 * jobs)}-{number}"
        )

    with ThreadPoolExecutor(jobs) as pool:
        ends = list(pool.map(one, enumerate(attempts)))
    return [(what, why) for what, why in ends if why]


if __name__ == "__main__":
    raise SystemExit(main())
