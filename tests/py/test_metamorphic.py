"""A few machines and runs of what the adversary does by the hundred: relations, and no leak."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from patience import PATIENCE

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from tests.adversary import metamorphic

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("seed", range(1, 9))
def test_runs_between_which_theory_knows_the_difference(seed: int) -> None:
    found = dict(metamorphic.checked(seed))
    assert set(metamorphic.RELATIONS) - set(found) <= {"run in two parts"}
    assert all(found.values()), found


def test_a_broken_relation_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inertias that stay as they are while torques grow fourfold move otherwise."""
    monkeypatch.setattr(metamorphic, "_masses", lambda unit: int(unit.startswith("N*m")))
    assert not dict(metamorphic.checked(1))["four times as heavy"]


@pytest.mark.long
def test_the_same_work_again_and_again_takes_no_more_memory() -> None:
    command = [sys.executable, "-m", "tests.adversary.leak", "--runs", "1000"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stdout + done.stderr
