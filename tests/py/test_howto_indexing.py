"""docs/howto/indexing.md does what it prints."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from dualdrive_cli.main import main

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "howto" / "indexing.md").read_text()


def blocks(language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.M | re.S)
    assert found, f"no {language} block: this test looks for the wrong thing"
    return found


def test_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in zip(("wide.csv", "long.csv"), blocks("csv"), strict=True):
        Path(name).write_text(text)
    for line in "".join(blocks("sh")).splitlines():
        program, *words = shlex.split(line)
        assert program == "dualdrive"
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 0, f"{line}: {result.output}"
    assert {"chart.png", "wide.pdf", "wide.json", "gap.h5"} <= {p.name for p in tmp_path.iterdir()}


def test_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for block in blocks("python"):
        exec(compile(block, "indexing.md", "exec"), {})
    assert Path("dual.png").exists()
