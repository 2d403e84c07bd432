"""Every example runs and says something.

The search of the second one is the demo's, which test_demo_story.py looks at: here its place is
taken by a diagnosis that was made up, unless SHOWN=1 runs it whole.
"""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import diagnosed
import dualdrive.diagnose
from patience import PATIENCE

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("[0-9]*.py"))
SEARCHES = "02_a_missing_effect"


def looked_over(printed: str, folder: Path) -> None:
    assert printed.strip()
    assert "nan" not in printed.lower()
    assert not list(folder.iterdir()), "an example leaves nothing behind"


@pytest.mark.parametrize(
    "example",
    [path for path in EXAMPLES if path.stem != SEARCHES or "SHOWN" in os.environ],
    ids=lambda path: path.stem,
)
def test_it_runs(example: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(example)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stderr
    looked_over(done.stdout, tmp_path)


def test_it_runs_on_a_diagnosis_made_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dualdrive.diagnose, "diagnose", lambda *_, **__: diagnosed.diagnosis())
    [example] = [path for path in EXAMPLES if path.stem == SEARCHES]
    runpy.run_path(str(example))
    printed = capsys.readouterr().out
    looked_over(printed, tmp_path)
    assert "coulomb@table.torque = 2010" in printed
