"""What the sensors alone leave: seen at standstill, within what the record itself allows."""

from __future__ import annotations

import numpy as np
import pytest

from dualdrive.diagnose.confront import Series
from dualdrive.diagnose.floors import floor_of, ratios

rng = np.random.default_rng(5)
T = 1e-3 * np.arange(3000.0)
STILL = (T < 0.8) | (T > 2.2)
NOISE = rng.normal(size=len(T))


def series(floor: float, still: np.ndarray = STILL) -> Series:
    every = np.ones(len(T), dtype=bool)
    return Series("r", "e", "", "rad", T, np.sin(T), floor, np.cos(T), every, still)


def test_what_is_left_at_standstill_is_the_floor() -> None:
    left = np.where(STILL, 0.8, 5.0) * NOISE
    assert floor_of(series(1.0), left) == pytest.approx(0.8, rel=0.05)


def test_dry_friction_may_hold_another_torque_at_every_standstill() -> None:
    left = 0.8 * NOISE + np.where(T > 2.0, 40.0, -3.0)
    assert floor_of(series(1.0), left) == pytest.approx(0.8, rel=0.05)


def test_noise_that_a_filter_has_coloured_is_no_misfit() -> None:
    """A tenth of it is white: the spectrum above the signal shows a third of its size."""
    assert floor_of(series(0.32), 0.9 * NOISE) == pytest.approx(0.9, rel=0.05)


def test_a_model_that_hunts_at_standstill_leaves_no_noise() -> None:
    assert floor_of(series(0.1), 20.0 * NOISE) == pytest.approx(0.3)
    assert floor_of(series(0.1), 1e-3 * NOISE) == pytest.approx(0.05), "nor is it ever so quiet"


def test_without_a_standstill_the_record_speaks_for_itself() -> None:
    assert floor_of(series(0.7, np.zeros(len(T), dtype=bool)), 5.0 * NOISE) == 0.7
    assert floor_of(series(0.7, T < 0.05), 5.0 * NOISE) == 0.7, "too short to show its noise"


def test_the_best_hypothesis_tells_the_floor_and_every_other_is_held_against_it() -> None:
    [share] = ratios([series(1.0)], [3.0 * NOISE], [1.0 * NOISE])
    assert share == pytest.approx(3.0, rel=0.05)
