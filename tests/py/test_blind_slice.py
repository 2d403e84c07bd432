"""A slice of the blind suite, strong effects: four cases, or with BLIND_SLICE=1 twelve."""

from __future__ import annotations

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind import run, score
from tests.blind.generator import suite
from tests.blind.scoring import figures, text
from tests.blind.scoring.figures import Judged

BUDGET = 60.0  # s for each case, several times what most of them need
WHOLE = "BLIND_SLICE" in os.environ
EVERY: list[suite.Order] = [
    (0, "none", ()),
    (2, "drifted", ()),
    (4, "single", ("coulomb",)),
    (5, "single", ("mesh_damping",)),
    (1, "none", ()),
    (3, "drifted", ()),
    (6, "single", ("cogging",)),
    (7, "single", ("eccentricity",)),
    (8, "single", ("hydrostatic_drag",)),
    (9, "single", ("unbalance",)),
    (10, "outside", ()),
    (11, "two", ("coulomb", "cogging")),
]
ORDERS = EVERY if WHOLE else EVERY[:4]
WRONG = 3 if WHOLE else 1  # at most: even strong effects may hide in a record that was drawn


def judged(folder: Path) -> list[Judged]:
    suite.generate(folder, "dev", ORDERS, share=0.05, tell=lambda _: None)
    cases = sorted((folder / "cases").iterdir())
    (folder / "out").mkdir()
    tasks = [
        run.Task(c, folder / "out" / f"{c.name}.json", BUDGET, "dualdrive.diagnose:diagnose")
        for c in cases
    ]
    assert run.run(tasks, budget=600, jobs=os.cpu_count() or 1, tell=lambda _: None) == 0
    return score.judged(folder, [folder / "out"])


def test_a_slice_is_judged_as_it_should_be(tmp_path: Path) -> None:
    cases = judged(tmp_path)
    page = text.page(figures.everything(cases))
    assert [c.failed for c in cases] == [""] * len(ORDERS), page
    quiet = {c.verdict for c in cases if c.group in ("none", "drifted")}
    assert quiet <= {"adequate", "parameters"}, page
    assert sum(not figures.right(c) for c in cases) <= WRONG, page
