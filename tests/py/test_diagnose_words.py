"""What an engineer reads: numbers with units, reasons that hold, nothing that says nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dualdrive.diagnose.free_torque import Course
from dualdrive.diagnose.judge import Judgement
from dualdrive.diagnose.result import Candidate, Interval, Shape, Verdict
from dualdrive.diagnose.words import paragraph

ERROR = {"nominal": 0.3, "refitted": 0.2, "noise_floor": 0.01}


def candidate(label: str = "cogging@motors", **numbers: Any) -> Candidate:
    effect, place = label.split("@")
    rest = {"explained": 0.95, "note": "", **numbers}
    parameters = rest.pop("parameters", {})
    return Candidate(((effect, place),), 0.9, parameters, 0.02, 0.02, 900.0, **rest)


def shape(explained: float) -> Shape:
    none = np.zeros(2)
    return Shape("table", "speed", "rad/s", "N*m", none, none, none, none, explained)


def said(verdict: Verdict, *candidates: Candidate, **more: Any) -> str:
    told = {"shapes": (), "warnings": (), "equation": None, "why": "", "course": None, **more}
    return paragraph(
        Judgement(verdict, (), 0.0, (), 0.0, (1.0, 1.0), 0.0, told["why"], told["course"]),
        candidates,
        (),
        ERROR,
        told["equation"],
        told["shapes"],
        None,
        told["warnings"],
        "dualdrive add",
        (),
    )


def test_numbers_have_units_what_was_counted_no_interval_and_what_is_held_at_nothing_no_word() -> (
    None
):
    text = said(
        "effect",
        candidate(
            parameters={
                "transport_delay@controller.delta_c": Interval(3e-3, 2e-3, 4e-3, "s"),
                "transport_delay@controller.delta_t": Interval(0.0, 0.0, 0.0, "s"),
                "cogging@motors.order": Interval(12.0, 12.0, 12.0, ""),
            }
        ),
    )
    assert "delta_c 0.003 s [0.002 .. 0.004], order 12." in text
    assert "delta_t" not in text


@pytest.mark.parametrize(
    ("why", "words"),
    [
        ("explains", "too little for a name"),
        ("bound", "not at a size that it can have"),
        ("bent", "only bends the curve of the first"),
        ("clipped", "a channel stands at its limit"),
        ("gains", "not beyond doubt"),
    ],
)
def test_why_the_best_of_them_gets_no_name(why: str, words: str) -> None:
    assert words in said("unknown", candidate(), why=why)


def test_a_coordinate_that_tells_nothing_is_not_recommended() -> None:
    assert "spline" in said("unknown", shapes=[shape(0.6)])
    text = said("unknown", shapes=[shape(0.0)])
    assert "spline" not in text
    assert "no coordinate that was tried" in text


def test_warnings_are_told_apart() -> None:
    text = said("adequate", warnings=["fast: it jitters.", "slow: it jitters, too"])
    assert text.endswith("Mind: fast: it jitters; slow: it jitters, too.")
    assert "4 warnings" in said("adequate", warnings=["a"] * 4)


def test_what_is_left_beside_a_name_is_told_with_its_place() -> None:
    course = Course("readings", "I_1", 60.0, 5, -9.3)
    text = said("effect", candidate(), course=course)
    assert "an error of the reading I_1 that grows in time" in text
    assert "10^9" in text
    torque = Course("acceleration", "motor_2", 60.0, 8, -7.0)
    text = said("unknown", candidate(), why="course", course=torque)
    assert "a torque at motor_2 that follows the table's past acceleration" in text
    assert "The best of them" not in text, "it explains nothing of that"
