"""A slice of the blind suite: strong effects, twelve records, a short budget for each."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

pytest.importorskip("dualdrive.diagnose.diagnose")
if "BLIND_SLICE" not in os.environ:
    pytest.skip("needs minutes and a machine of its own: BLIND_SLICE=1", allow_module_level=True)
sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind import run, score
from tests.blind.generator import suite
from tests.blind.scoring import figures, text
from tests.blind.scoring.figures import Judged

BUDGET = 8.0  # s for each case, on a machine that has nothing else to do
RIGHT = 3  # of twelve, measured on a busy machine; raise it as the diagnosis gets better
ORDERS: list[suite.Order] = [
    *((n, "none", ()) for n in range(2)),
    *((n, "drifted", ()) for n in range(2, 4)),
    (4, "single", ("coulomb",)),
    (5, "single", ("mesh_damping",)),
    (6, "single", ("cogging",)),
    (7, "single", ("eccentricity",)),
    (8, "single", ("hydrostatic_drag",)),
    (9, "single", ("unbalance",)),
    (10, "outside", ()),
    (11, "two", ("coulomb", "cogging")),
]


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> list[Judged]:
    folder = tmp_path_factory.mktemp("slice")
    suite.generate(folder, "dev", ORDERS, share=0.05, tell=lambda _: None)
    cases = sorted((folder / "cases").iterdir())
    (folder / "out").mkdir()
    tasks = [
        run.Task(c, folder / "out" / f"{c.name}.json", BUDGET, "dualdrive.diagnose:diagnose")
        for c in cases
    ]
    left = run.run(tasks, budget=300, jobs=os.cpu_count() or 1, tell=lambda _: None)
    assert left == 0
    return score.judged(folder, [folder / "out"])


def test_every_case_is_answered(judged: list[Judged]) -> None:
    assert [c.failed for c in judged] == [""] * len(ORDERS)


def test_a_machine_that_lacks_nothing_is_told_nothing(judged: list[Judged]) -> None:
    assert {c.verdict for c in judged if c.group == "none"} <= {"adequate", "parameters"}


def test_so_many_are_right(judged: list[Judged]) -> None:
    page = text.page(figures.everything(judged))
    assert sum(map(figures.right, judged)) >= RIGHT, page
