"""Verdicts on surveys made up for it: what a gain is worth, and where it names nothing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dualdrive.diagnose import judge as judging
from dualdrive.diagnose import survey
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.judge import Judgement, judge

ABOVE, AT, BELOW = [3.0, 1.5], [1.02, 1.0], [0.9, 0.8]  # residual over floor, of two series


class Verdict:
    """What is said of one law that gains so much."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.patch = monkeypatch

    def __call__(self, before: list[float], after: list[float], gain: float = 200.0) -> Judgement:
        base: Any = SimpleNamespace(hypothesis=Hypothesis(), left="base")
        best: Any = SimpleNamespace(
            hypothesis=Hypothesis((("unbalance", "table"),)), left="best", beyond=lambda: False
        )
        found: Any = SimpleNamespace(
            base=base,
            plain=base,
            criterion={"nothing": 0.0, "unbalance@table": -gain},
            scores=[None] * 100,
            twins={},
        )
        left = {"base": np.array(before), "best": np.array(after)}
        self.patch.setattr(judging, "probabilities", lambda _: ([(best, 0.95)], 0.05))
        self.patch.setattr(judging, "excess", lambda _, which: left[which])
        self.patch.setattr(judging, "_foretells", lambda *_: True)
        self.patch.setattr(judging, "_sound", lambda _: "adequate")
        self.patch.setattr(survey, "excess", lambda _, which: left[which])
        return judge(found)


@pytest.fixture
def verdict(monkeypatch: pytest.MonkeyPatch) -> Verdict:
    return Verdict(monkeypatch)


def test_a_law_that_explains_what_is_left_has_its_name(verdict: Verdict) -> None:
    assert verdict(ABOVE, AT).verdict == "effect"


def test_at_its_floor_nothing_is_named_whatever_gains(verdict: Verdict) -> None:
    """The floor is reckoned: what gains below it, gains by the colour of the noise."""
    assert verdict(BELOW, BELOW, gain=120.0).verdict == "adequate"


def test_a_small_gain_names_nothing(verdict: Verdict) -> None:
    assert verdict(AT, AT, gain=20.0).verdict == "adequate"
    told = verdict(ABOVE, ABOVE, gain=20.0)
    assert (told.verdict, told.why) == ("unknown", "gains")


def test_a_law_that_explains_too_little_is_not_the_one(verdict: Verdict) -> None:
    """Less than half of what stands above the floor has no name; less than 0.75 none either, where
    more than the floor is left."""
    told = verdict(ABOVE, [2.8, 1.4])
    assert (told.verdict, told.why) == ("unknown", "gains")
    told = verdict([6.0, 3.0], [3.8, 1.9])
    assert (told.verdict, told.why) == ("unknown", "explains")
