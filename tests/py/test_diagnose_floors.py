"""What stands above what the sensors alone leave, and what a probe must be heard above."""

from __future__ import annotations

import numpy as np
import pytest

from dualdrive.diagnose.confront import Series
from dualdrive.diagnose.floors import heard_above, ratios

T = 1e-3 * np.arange(3000.0)
NOISE = np.random.default_rng(5).normal(size=len(T))


def series(floor: float, count: int = len(T)) -> Series:
    return Series("r", "total", T, np.sin(T), floor, np.cos(T), np.arange(len(T)) < count)


def test_what_is_left_is_held_against_the_floor() -> None:
    several = ratios([series(1.0), series(0.5)], [3.0 * NOISE, NOISE])
    assert several == pytest.approx([3.0, 2.0], rel=0.05)


def test_a_series_of_a_few_samples_shows_nothing() -> None:
    assert ratios([series(1.0), series(1.0, 30)], [3.0 * NOISE, 9.0 * NOISE]) == pytest.approx(
        [3.0], rel=0.05
    )
    assert ratios([series(1.0, 30)], [9.0 * NOISE]) == pytest.approx([1.0])


def test_a_probe_is_heard_above_the_floor_and_above_what_is_left() -> None:
    assert heard_above(series(0.7), 0.1 * NOISE) == 0.7
    assert heard_above(series(0.7), 5.0 * NOISE) == pytest.approx(5.0, rel=0.05)
    none = heard_above(series(0.0), 0.0 * NOISE)
    assert none == pytest.approx(1e-3 * np.std(np.sin(T))), "a thousandth of the signal"
