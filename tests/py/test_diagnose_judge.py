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

    def __call__(
        self, mode: str, before: list[float], after: list[float], gain: float = 200.0
    ) -> Judgement:
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
            evidence=SimpleNamespace(confrontation=SimpleNamespace(mode=mode)),
        )
        left = {"base": np.array(before), "best": np.array(after)}
        self.patch.setattr(judging, "probabilities", lambda _: ([(best, 0.95)], 0.05))
        self.patch.setattr(judging, "excess", lambda _, which: left[which])
        self.patch.setattr(judging, "_foretells", lambda *_: True)
        self.patch.setattr(judging, "_sound", lambda _: "adequate")
        self.patch.setattr(survey, "excess", lambda _, which: left[which])
        return judge(found, lambda _: [])


@pytest.fixture
def verdict(monkeypatch: pytest.MonkeyPatch) -> Verdict:
    return Verdict(monkeypatch)


@pytest.mark.parametrize("mode", ["closed_loop", "balance"])
def test_a_law_that_explains_what_is_left_has_its_name(verdict: Verdict, mode: str) -> None:
    assert verdict(mode, ABOVE, AT).verdict == "effect"


def test_a_torque_balance_at_its_floor_names_nothing_whatever_gains(verdict: Verdict) -> None:
    """Its floor is reckoned: what gains below it, gains by the colour of the noise."""
    assert verdict("balance", BELOW, BELOW, gain=120.0).verdict == "adequate"
    assert verdict("closed_loop", AT, AT, gain=120.0).verdict == "effect", "a floor that was seen"


def test_a_small_gain_names_nothing(verdict: Verdict) -> None:
    assert verdict("closed_loop", AT, AT, gain=30.0).verdict == "adequate"
    told = verdict("closed_loop", ABOVE, ABOVE, gain=30.0)
    assert (told.verdict, told.why) == ("unknown", "gains")


def test_a_law_that_explains_too_little_is_not_the_one(verdict: Verdict) -> None:
    told = verdict("closed_loop", ABOVE, [2.8, 1.4])
    assert (told.verdict, told.why) == ("unknown", "explains")
