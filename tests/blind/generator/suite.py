"""A suite: which cases it has, and its files on disk.

FOLDER/cases/case-0007/{machine.toml, fast.csv, slow.csv, case.json}    handed out
FOLDER/labels.jsonl                                                     sealed
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from tests.blind.generator import cases, effects

#: what suites are drawn from; nobody tunes anything on a sealed one
PHRASES = {
    "dev": "tune on these",
    "sealed": "judged on these, seen by nobody before",
    "sealed-2": "the next ones, once the others had all been read",
    "sealed-3": "and the ones after those, whole",
}
#: shares of the groups where only a count is given
USUAL = {"single": 0.32, "none": 0.16, "drifted": 0.16, "outside": 0.18, "two": 0.18}
FULL = {"single": 124, "none": 150, "drifted": 150, "outside": 48, "two": 48}
#: effects that the first library had
FIRST = (
    *("viscous", "coulomb", "stribeck", "lugre", "cogging", "torque_ripple"),
    *("eccentricity", "mesh_damping", "sensor_delay"),
)

Order = tuple[int, str, tuple[str, ...]]


def seed_of(suite: str) -> int:
    """The seed that all of a suite's randomness comes from."""
    return int.from_bytes(hashlib.sha256(PHRASES[suite].encode()).digest()[:6], "big")


def counts_of(count: int) -> dict[str, int]:
    """So many cases of each group, every group with at least one."""
    return {group: max(1, round(share * count)) for group, share in USUAL.items()}


def orders(suite: str, counts: Mapping[str, int], pool: tuple[str, ...] = ()) -> list[Order]:
    """(number, group, effects to draw from) of each case; numbers tell nothing of the group.

    Effects of single cases take turns, so that each of the pool is hidden equally often.
    """
    pool = pool or tuple(effects.EFFECTS)
    rng = np.random.default_rng([seed_of(suite), sum(counts.values())])
    turn = [str(name) for name in rng.permutation(pool)]
    wanted: list[tuple[str, tuple[str, ...]]] = []
    for group in cases.GROUPS:
        for k in range(counts.get(group, 0)):
            wanted.append((group, (turn[k % len(turn)],) if group == "single" else pool))
    order = rng.permutation(len(wanted))
    return [(n, *wanted[int(k)]) for n, k in enumerate(order)]


def generate(
    folder: Path,
    suite: str,
    wanted: list[Order],
    share: float | None = None,
    tell: Callable[[str], None] = print,
) -> None:
    """Write the suite; cases that stand already are left as they are. `share`: `cases.build`."""
    (folder / "cases").mkdir(parents=True, exist_ok=True)
    for number, group, names in wanted:
        place = folder / "cases" / f"case-{number:04d}"
        if place.exists():
            continue
        case = cases.build(seed_of(suite), number, group, names, share)
        fresh = place.with_suffix(".fresh")
        shutil.rmtree(fresh, ignore_errors=True)
        case.write(fresh)
        with (folder / "labels.jsonl").open("a") as labels:
            labels.write(json.dumps(case.label) + "\n")
        fresh.rename(place)
        tell(f"{place.name} written")


def labels(folder: Path) -> dict[str, dict[str, Any]]:
    """Sealed labels by case; of a case written twice the last one counts."""
    rows = [json.loads(line) for line in (folder / "labels.jsonl").read_text().splitlines()]
    return {row["case"]: row for row in rows}
