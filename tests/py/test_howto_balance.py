"""docs/howto/torque-balance.md runs as printed and finds what was put in."""

from __future__ import annotations

from pathlib import Path

import pytest

from howto import Page


def test_the_blocks_run_and_find_what_was_put_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    seen = Page("torque-balance.md").run_python()
    before, after, play = seen["before"], seen["after"], seen["play"]
    assert before.error > 2 * after.error
    true = {"table.J": 95.0, "table.b": 200.0, "coulomb@table.torque": 20.0}
    for path, value in true.items():
        found = after.parameters[path]
        assert found.value == pytest.approx(value, rel=0.02)
        assert found.low < value < found.high
    assert play.full.low < 0.8 < play.full.high
    assert play.full.high - play.full.low < 0.1
    assert (tmp_path / "play.png").stat().st_size > 10_000
