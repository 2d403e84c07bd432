"""docs/howto/limit-cycles-and-bode.md does what it prints."""

from __future__ import annotations

from pathlib import Path

import pytest

from howto import Page

PAGE = Page("limit-cycles-and-bode.md")


@pytest.mark.long
def test_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    printed = PAGE.run_commands()
    for figure in ("17.4 dB at 4.13 Hz", "51.798 arcsec", "20.492", "40.984", "81.969"):
        assert figure in printed
        assert figure in PAGE.text or figure == "17.4 dB at 4.13 Hz"


def test_python(capsys: pytest.CaptureFixture[str]) -> None:
    PAGE.run_python()
    assert "the drives differ from 15 Hz on" in capsys.readouterr().out
