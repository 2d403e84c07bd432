"""The three disjoint parts, what each of their cases is to be, and their files on disk.

FOLDER/cases/develop-00007/{machine.toml, case.json, one file per record}    handed out
FOLDER/truth/develop-00007.json                                              kept apart
"""

from __future__ import annotations

import json
import multiprocessing
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tests.blind.generator import cases, effects, outside, stored
from tests.blind.generator.cases import Wanted

#: first seed of a part; the sealed ones follow from the number that is said when they are made
FIRST = {"develop": 0, "calibrate": 100_000}
_SEALED = 1_000_000
MOST = 100_000
#: of which groups so many cases are; the last share is of loops that nobody knows
SHARES = {"single": 0.45, "empty": 0.125, "drifted": 0.125, "pair": 0.12, "outside": 0.10}
_UNKNOWN = {"single": 0.5, "empty": 0.175, "drifted": 0.175, "outside": 0.15}
_GOLDEN = (5**0.5 - 1) / 2


@dataclass(frozen=True)
class Part:
    """develop, calibrate, or sealed with a number of its own (1, 2, ...)."""

    name: str
    first: int

    def case(self, k: int) -> str:
        """The name of case k."""
        return f"{self.name}-{k:05d}"

    def build(self, k: int) -> cases.Case:
        """Case k, whatever was made before it."""
        return cases.build(self.case(k), self.first + k, self.wanted(k))

    def wanted(self, k: int) -> Wanted:
        """What case k is to be: groups spread evenly over the numbers, effects in turns."""
        group, known = _group(k)
        if group == "outside":
            return Wanted(group, tuple(outside.OUTSIDE), known)
        pool = tuple(effects.EFFECTS)
        if group != "single":
            return Wanted(group, pool, known)
        if not known:
            pool = tuple(n for n in pool if n not in cases.OF_THE_LOOP)
        before = sum(_group(j) == (group, known) for j in range(k))
        rng = np.random.default_rng([self.first, before // len(pool)])
        return Wanted(group, (str(rng.permutation(pool)[before % len(pool)]),), known)


def part(name: str, seed: int | None = None) -> Part:
    """The part of that name; only the sealed one takes, and needs, a seed."""
    if name in FIRST and seed is None:
        return Part(name, FIRST[name])
    if name == "sealed" and seed is not None and seed >= 1:
        return Part(f"sealed-{seed}", _SEALED * seed)
    raise ValueError(f"part {name} with seed {seed}: sealed takes a seed of 1 or more, others none")


def _group(k: int) -> tuple[str, bool]:
    """(group, whether the loop is known) of case k: a sequence without clusters."""
    place = (0.5 + k * _GOLDEN) % 1.0
    for group, share in SHARES.items():
        if place < share:
            return group, True
        place -= share
    place /= 1 - sum(SHARES.values())
    for group, share in _UNKNOWN.items():
        if place < share:
            return group, False
        place -= share
    return "outside", False


def generate(
    folder: Path, of: Part, numbers: range, jobs: int = 1, tell: Callable[[str], None] = print
) -> None:
    """Write the cases; those that stand already are left as they are."""
    (folder / "cases").mkdir(parents=True, exist_ok=True)
    (folder / "truth").mkdir(exist_ok=True)
    missing = [k for k in numbers if not (folder / "cases" / of.case(k)).exists()]
    if jobs == 1:
        for k in missing:
            tell(_write(folder, of, k))
        return
    with multiprocessing.get_context("fork").Pool(jobs) as pool:
        for said in pool.imap_unordered(partial(_write, folder, of), missing):
            tell(said)


def _write(folder: Path, of: Part, k: int) -> str:
    case = of.build(k)
    fresh = folder / "cases" / f"{case.name}.fresh"
    shutil.rmtree(fresh, ignore_errors=True)
    stored.write(case, fresh)
    text = json.dumps(case.truth, indent=1) + "\n"
    (folder / "truth" / f"{case.name}.json").write_text(text)
    fresh.rename(folder / "cases" / case.name)
    return f"{case.name} written"


def truths(folder: Path) -> dict[str, dict[str, Any]]:
    """What was hidden, by case."""
    files = sorted((folder / "truth").glob("*.json"))
    return {path.stem: json.loads(path.read_text()) for path in files}
