"""docs/howto/compare-and-fit.md runs as printed and finds what the records hide."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from dualdrive import Machine
from dualdrive_cli.main import main
from recorded import DEMO, maker

HOWTO = Path(__file__).resolve().parents[2] / "docs" / "howto" / "compare-and-fit.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", HOWTO.read_text("utf-8"), re.DOTALL)


def test_the_code_runs_and_the_error_falls(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    for code in blocks("python"):
        exec(compile(code, str(HOWTO), "exec"), names)
    improved, refitted, hidden = names["improved"], names["refitted"], maker.truth()["effect"]
    assert names["found"].error["headline"] > 0.15
    assert refitted.error["refitted"] > 0.5 * refitted.error["nominal"]
    assert improved.error["refitted"] < 0.1 * refitted.error["refitted"]
    torque = names["torque"]
    assert torque.low < hidden["torque"] < torque.high
    printed = capsys.readouterr().out
    assert "barely determined" in printed
    assert "prior" in printed


def test_the_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("machine.toml", "fit.csv", "held_out.csv"):
        shutil.copy(DEMO / name, tmp_path)
    for line in blocks("sh")[0].strip().splitlines():
        done = CliRunner().invoke(main, shlex.split(line)[1:])
        assert done.exit_code == 0, done.output
    assert (tmp_path / "compare.png").stat().st_size > 10_000
    fitted = Machine.load("fitted.toml")
    hidden = maker.truth()["effect"]["torque"]
    assert fitted.get("coulomb@table.torque") == pytest.approx(hidden, rel=0.01)
    assert fitted.history[-1]["command"].startswith("dualdrive")
    assert fitted.history[-1]["change"].startswith("fitted to fit")
