"""docs/howto/compare-and-fit.md runs as printed and finds what the records hide."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from dualdrive import Machine
from howto import Page, typed
from recorded import DEMO, maker

PAGE = Page("compare-and-fit.md")


@pytest.mark.long
def test_the_code_runs_and_the_error_falls(capsys: pytest.CaptureFixture[str]) -> None:
    names = PAGE.run_python()
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
    for line in PAGE.blocks("sh")[0].splitlines():
        done = typed(line.removeprefix("dualdrive "))
        assert done.exit_code == 0, done.output
    assert (tmp_path / "compare.png").stat().st_size > 10_000
    fitted = Machine.load("fitted.toml")
    hidden = maker.truth()["effect"]["torque"]
    assert fitted.get("coulomb@table.torque") == pytest.approx(hidden, rel=0.01)
    assert fitted.history[-1]["command"].startswith("dualdrive")
    assert fitted.history[-1]["change"].startswith("fitted to fit")
