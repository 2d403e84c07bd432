"""docs/howto/sweep.md does what it prints."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from dualdrive.figures import declared
from dualdrive.machine import Machine
from dualdrive_cli.main import main

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "howto" / "sweep.md").read_text()


def blocks(language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.M | re.S)
    assert found, f"no {language} block: this test looks for the wrong thing"
    return found


def test_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for line in "".join(blocks("sh")).splitlines():
        program, *words = shlex.split(line)
        assert program == "dualdrive"
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 0, f"{line}: {result.output}"
    assert {"sweep.h5", "tension.h5", "tension.png", "bench.h5"} <= {
        p.name for p in tmp_path.iterdir()
    }


def test_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for block in blocks("python"):
        exec(compile(block, "sweep.md", "exec"), {})
    assert (tmp_path / "hunting.png").exists()


def test_every_figure_is_explained() -> None:
    table = PAGE.partition("## Figures")[2].partition("\nOn a linear axis")[0]
    for figure in declared(Machine.load()):
        name = re.sub(r"_2\.", "_1.", figure.name)
        assert f"`{name}`" in table, figure.name
