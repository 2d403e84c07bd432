"""Where refits begin: the best of several starts, none that is not worth its time; the clock."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.pairs import together
from dualdrive.diagnose.refit import Fitter, Start
from dualdrive.diagnose.work import Clock

DRY = Hypothesis((("coulomb", "table"),))
TORQUE = "coulomb@table.torque"


class Valley:
    """Evidence whose chi^2 is the distance of the friction torque from 0.3 N*m."""

    def __init__(self) -> None:
        self.seen: list[float] = []
        self.confrontation: Any = SimpleNamespace(
            core=Machine.load("bench").core,
            low=np.full(1, -np.inf),
            high=np.full(1, np.inf),
            sizes=lambda: {"torque": 1.0, "speed": 1.0, "travel": 1.0},
            left=self.left,
        )

    def left(self, machine: Any, _: Any) -> list[Any]:
        self.seen.append(machine.get(TORQUE))
        return [np.array([abs(self.seen[-1] - 0.3)])]

    def chi(self, _: Any, left: list[Any]) -> float:
        return float(left[0][0])


def starts(*torques: float, further: bool) -> list[Start]:
    return [
        Start(np.zeros(1), {TORQUE: torque}, further=further and k > 0)
        for k, torque in enumerate(torques)
    ]


def test_the_best_start_counts() -> None:
    valley: Any = Valley()
    trial = Fitter(valley).tried(DRY, starts(0.05, 0.25, 0.8, further=False))
    assert trial is not None
    assert trial.chi == pytest.approx(0.05)
    assert valley.seen == pytest.approx([0.05, 0.25, 0.8])


def test_no_way_is_followed_further_that_led_up() -> None:
    valley: Any = Valley()
    Fitter(valley).tried(DRY, starts(0.2, 0.7, 1.5, further=True))
    assert valley.seen == pytest.approx([0.2, 0.7]), "1.5 lies further up"


def test_a_start_that_is_good_enough_ends_the_looking() -> None:
    valley: Any = Valley()
    Fitter(valley).tried(DRY, starts(0.29, 0.3, further=False), enough=0.02)
    assert valley.seen == pytest.approx([0.29])


def test_two_effects_that_can_not_sit_together_are_not_tried() -> None:
    """Both would move the same stiffness."""
    valley: Any = Valley()
    both = Hypothesis((("shaft_compliance", "gearboxes"), ("gearbox_backlash", "gearboxes")))
    with pytest.raises(ValueError, match="keep one"):
        Fitter(valley).tried(both, [Start(np.zeros(1), {})])
    assert together(Fitter(valley), both, [Start(np.zeros(1), {})]) is None


def test_a_clock_that_ran_out_says_what_it_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    clock = Clock(10.0)
    assert clock.allows("the shape")
    now[0] = 106.0
    assert not clock.stop()
    now[0] = 110.5
    assert clock.stop()
    assert not clock.allows("the next experiment")
    assert clock.cut == ["the next experiment"]


def test_a_user_stops_the_clock() -> None:
    assert Clock(1e9, lambda: True).stop()
