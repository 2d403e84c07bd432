"""docs/howto/limit-cycles-and-bode.md does what it prints."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from dualdrive_cli.main import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "limit-cycles-and-bode.md"


def blocks(language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", PAGE.read_text(), re.M | re.S)
    assert found, f"no {language} block: this test looks for the wrong thing"
    return found


def test_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    printed = ""
    for line in "".join(blocks("sh")).splitlines():
        program, *words = shlex.split(line)
        assert program == "dualdrive"
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 0, f"{line}: {result.output}"
        printed += result.output
    for figure in ("17.4 dB at 4.13 Hz", "51.798 arcsec", "20.492", "40.984", "81.969"):
        assert figure in printed
        assert figure in PAGE.read_text() or figure == "17.4 dB at 4.13 Hz"


def test_python(capsys: pytest.CaptureFixture[str]) -> None:
    for block in blocks("python"):
        exec(compile(block, PAGE.name, "exec"), {})
    assert "the drives differ from 15 Hz on" in capsys.readouterr().out
