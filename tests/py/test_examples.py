"""Every example runs and says something; the second one does in test_diagnose.py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("[0-9]*.py"))
ELSEWHERE = "02_a_missing_effect"


@pytest.mark.parametrize(
    "example", [path for path in EXAMPLES if path.stem != ELSEWHERE], ids=lambda path: path.stem
)
def test_it_runs(example: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(example)], capture_output=True, text=True, cwd=tmp_path, timeout=600
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert "nan" not in done.stdout.lower()
    assert not list(tmp_path.iterdir()), "an example leaves nothing behind"
