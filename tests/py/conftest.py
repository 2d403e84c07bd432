"""Fixtures that several files share."""

from __future__ import annotations

import pytest

import core_machines


@pytest.fixture(params=["auto", "cvode"])
def both_engines(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a test with the engine that suits the machine, and with CVODE."""
    monkeypatch.setattr(core_machines, "ENGINE", request.param)
