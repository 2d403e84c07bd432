"""The how-to on traces is executed as it stands, and what it claims is checked."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive.traces import KINDS, ColumnRule, FileLayout, RowRule, SplitRule, TimeRule

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "traces.md"
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.fixture
def after(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The names the page's code leaves behind, run in a folder with the page's files."""
    monkeypatch.chdir(tmp_path)
    for name, _, content in re.findall(r"^`(\S+)`\n```(csv|toml)\n(.*?)```", TEXT, re.M | re.S):
        Path(name).write_text(content, encoding="utf-8")
    names: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", TEXT, re.S):
        exec(compile(code, str(PAGE), "exec"), names)
    return names


def test_the_code_runs_and_does_what_the_page_says(after: dict[str, Any]) -> None:
    trace = after["trace"]
    assert trace.log["repeated_row"][0].rows == (5,)
    assert trace.log["missing"][0].rows == (6,)
    np.testing.assert_allclose(trace["oil"], 304.15)
    np.testing.assert_allclose(np.diff(after["even"].t), 0.005)
    assert Path("table.h5").exists()
    assert Path("proposal.toml").read_text().startswith("# Proposal for log.csv")
    part = after["part"]
    assert part.labels == {"Test": 2.0}
    np.testing.assert_allclose(part["T_1"], -0.15 * 120)
    np.testing.assert_allclose(part["I_1"], 1.5 * np.sqrt(3))
    np.testing.assert_allclose(part["theta_1"], (np.array([27, 38]) + 4096) / 4096 * 2 * np.pi)
    assert part.name == "log[Test=2]"


def test_every_key_and_kind_is_on_the_page() -> None:
    rules = (ColumnRule, TimeRule, FileLayout, RowRule, SplitRule)
    keys = {key.name for rule in rules for key in fields(rule)}
    assert {name for name in keys | set(KINDS) if f"`{name}`" not in TEXT} == set()
