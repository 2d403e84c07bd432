"""In which order a survey refits: a leader far ahead has its partners before its rivals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dualdrive.diagnose import search
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.survey import Survey, key_of
from dualdrive.diagnose.work import Clock, Work

NOTHING = SimpleNamespace(hypothesis=Hypothesis(), left=())


def refit(*effects: str) -> Any:
    return SimpleNamespace(
        hypothesis=Hypothesis(tuple((e, "table") for e in effects)), left=(), chi=0.0
    )


def survey(refits: list[Any], values: dict[str, float]) -> Survey:
    base: Any = NOTHING
    criterion = {key_of(base): 1000.0, **values}
    seen: Any = None
    return Survey(seen, base, base, refits, criterion, 1.0, [])


class Shortlist:
    """Of a leader, coulomb, and a rival, viscous; tells what it was asked to do."""

    def __init__(self, asked: list[str], ahead: bool) -> None:
        self.asked, self.ahead = asked, ahead

    def leader(self, trials: object) -> list[Any]:
        return [refit("coulomb")]

    def far_ahead(self, leader: object, trials: object) -> bool:
        return self.ahead

    def again(self, trial: Any) -> Any:
        return trial

    def others(self, *_: object) -> tuple[list[Any], list[str]]:
        return [], []

    def __call__(self, trials: list[Any], scores: object, begun: list[Any]) -> Any:
        self.asked.append(f"refit {', '.join(t.hypothesis.label for t in trials)}")
        return [*begun, *trials], []


Refined = Callable[..., tuple[Survey, list[str]]]


@pytest.fixture
def refined(monkeypatch: pytest.MonkeyPatch) -> Refined:
    def run(ahead: bool, left: float, pair: float) -> tuple[Survey, list[str]]:
        """left: over the floor, by the pair that is found; pair: its criterion."""
        asked: list[str] = []

        def with_pairs(found: Survey, work: Work) -> Survey:
            both = refit("coulomb", "wear")
            asked.append(f"pairs of {found.best.hypothesis.label}")
            criterion = {**found.criterion, key_of(both): pair}
            return replace(found, refits=[*found.refits, both], criterion=criterion)

        def with_neighbours(found: Survey, work: Work) -> Survey:
            asked.append(f"neighbours of {found.best.hypothesis.label}")
            return found

        def settled(found: Survey, work: Work) -> Survey:
            values = {"coulomb@table": 500.0, "viscous@table": 600.0, "wear@table": 700.0}
            return replace(found, criterion={**values, **found.criterion})

        monkeypatch.setattr(search, "settle", settled)
        monkeypatch.setattr(search, "with_pairs", with_pairs)
        monkeypatch.setattr(search, "with_neighbours", with_neighbours)
        monkeypatch.setattr(search, "excess", lambda found, _: np.array([left]))
        short: Any = Shortlist(asked, ahead)
        trials: Any = [refit("coulomb"), refit("viscous")]
        work = Work(Clock(math.inf))
        found = search._refined(survey([], {}), [], trials, lambda _: short, True, work)
        return found, asked

    return run


def test_all_are_refitted_before_partners_are_sought(refined: Refined) -> None:
    _, asked = refined(ahead=False, left=3.0, pair=900.0)
    assert asked == ["refit viscous@table", "neighbours of coulomb@table", "pairs of coulomb@table"]


def test_a_pair_that_is_better_is_looked_about_too(refined: Refined) -> None:
    found, asked = refined(ahead=False, left=3.0, pair=100.0)
    assert asked[-1] == "neighbours of coulomb@table + wear@table"
    assert found.best.hypothesis.label == "coulomb@table + wear@table"


def test_a_leader_far_ahead_has_its_partners_before_its_rivals(refined: Refined) -> None:
    found, asked = refined(ahead=True, left=3.0, pair=100.0)
    assert asked == [
        "neighbours of coulomb@table",
        "pairs of coulomb@table",
        "neighbours of coulomb@table + wear@table",
        "refit viscous@table",
    ]
    labels = {r.hypothesis.label for r in found.refits}
    assert labels == {"coulomb@table", "viscous@table", "coulomb@table + wear@table"}


def test_nothing_more_is_refitted_where_its_partner_explains_all(refined: Refined) -> None:
    """It is not early where the leader itself explains all: then its rivals come as ever."""
    _, asked = refined(ahead=True, left=1.0, pair=100.0)
    assert asked[0] == "refit viscous@table"
