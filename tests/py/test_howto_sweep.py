"""docs/howto/sweep.md does what it prints."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dualdrive.figures import declared
from dualdrive.machine import Machine
from howto import Page

PAGE = Page("sweep.md")


@pytest.mark.long
def test_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    PAGE.run_commands()
    assert {"sweep.h5", "tension.h5", "tension.png", "bench.h5"} <= {
        p.name for p in tmp_path.iterdir()
    }


@pytest.mark.long
def test_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    PAGE.run_python()
    assert (tmp_path / "hunting.png").exists()


def test_every_figure_is_explained() -> None:
    table = PAGE.text.partition("## Figures")[2].partition("\nOn a linear axis")[0]
    for figure in declared(Machine.load()):
        name = re.sub(r"_2\.", "_1.", figure.name)
        assert f"`{name}`" in table, figure.name
