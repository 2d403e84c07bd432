"""docs/howto/find-what-is-missing.md: its code runs, its commands are commands."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import dualdrive.diagnose
from diagnosed import diagnosis, ladder
from dualdrive.diagnose import VERDICTS
from dualdrive.diagnose.experiment import TELLS_APART
from dualdrive_cli.main import main
from recorded import DEMO

TEXT = (Path(__file__).resolve().parents[2] / "docs/howto/find-what-is-missing.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


def test_the_code_runs(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    for code in blocks("python"):
        exec(compile(code, "howto", "exec"), names)
    assert names["best"].expected_distance > TELLS_APART
    assert "dualdrive diagnose" in capsys.readouterr().out


@pytest.mark.long
def test_the_commands_are_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What they find is tested elsewhere and takes minutes."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dualdrive.diagnose, "diagnose", lambda *_, **__: diagnosis())
    monkeypatch.setattr(dualdrive.diagnose, "improve", lambda *_, **__: ladder())
    for name in ("machine.toml", "fit.csv", "held_out.csv"):
        shutil.copy(DEMO / name, tmp_path)
    for line in "".join(blocks("sh")).strip().splitlines():
        done = CliRunner().invoke(main, shlex.split(line)[1:])
        assert done.exit_code == 0, done.output
    for name in ("improved.toml", "found.png", "better.toml", "report.html"):
        assert (tmp_path / name).exists()


def test_every_verdict_is_explained() -> None:
    assert set(re.findall(r"^\| `(\w+)` \|", TEXT, re.MULTILINE)) == set(VERDICTS)
