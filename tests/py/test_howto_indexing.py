"""docs/howto/indexing.md does what it prints."""

from __future__ import annotations

from pathlib import Path

import pytest

from howto import Page

PAGE = Page("indexing.md")


@pytest.mark.long
def test_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in zip(("wide.csv", "long.csv"), PAGE.blocks("csv"), strict=True):
        Path(name).write_text(text)
    PAGE.run_commands()
    assert {"chart.png", "wide.pdf", "wide.json", "gap.h5"} <= {p.name for p in tmp_path.iterdir()}


def test_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    PAGE.run_python()
    assert Path("dual.png").exists()
