"""Fixtures that several files share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import core_machines
from clusters import Cluster
from dualdrive import distributed

# the same examples on any computer, however busy; `tests.adversary.fuzz` draws others
settings.register_profile(
    "any computer", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any computer")


@pytest.fixture(params=["auto", "cvode"])
def both_engines(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a test with the engine that suits the machine, and with CVODE."""
    monkeypatch.setattr(core_machines, "ENGINE", request.param)


@pytest.fixture
def mortal(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler of the test's own, without workers yet, whose processes may be killed."""
    with Cluster(tmp_path) as cluster:
        yield cluster


@pytest.fixture
def hasty(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Little patience with schedulers that don't answer and workers that don't come.

    More with one that is there: on a busy computer it answers late.
    """
    monkeypatch.setattr(distributed, "CONNECT", 10.0 if "mortal" in request.fixturenames else 0.5)
    monkeypatch.setattr(distributed, "PATIENCE", 1.0)
