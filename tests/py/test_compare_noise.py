"""Noise floors against noise of known size, and conditions against hand-made situations."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from dualdrive.compare import noise_floor, where_it_fails
from dualdrive.compare.noise import like_noise, rounding_step
from dualdrive.compare.where import Situation, standing

Array = NDArray[np.float64]

T: Array = np.arange(4000, dtype=np.float64) * np.float64(1e-2)


def signal() -> Array:
    return np.sin(2 * np.pi * 0.3 * T) + 0.2 * np.sin(2 * np.pi * 2.1 * T)


def test_white_noise_under_a_signal() -> None:
    noise = np.random.default_rng(1).normal(0.0, 3e-3, len(T))
    assert noise_floor(T, signal() + noise).rms == pytest.approx(3e-3, rel=0.1)


def test_a_short_record_is_differenced() -> None:
    noise = np.random.default_rng(2).normal(0.0, 3e-3, 200)
    found = noise_floor(T[:200], signal()[:200] + noise)
    assert found.rms == pytest.approx(3e-3, rel=0.25)
    assert "differences" in found.how


def test_rounding_is_counted() -> None:
    step = 1e-2
    rounded = step * np.round(signal() / step)
    assert rounding_step(rounded) == pytest.approx(step)
    assert noise_floor(T, rounded).rms >= 0.99 * step / np.sqrt(12)
    assert rounding_step(signal()) == 0.0


def test_coloured_noise_shows_at_standstill_only() -> None:
    """First-order noise of corner 5 Hz: the top of its spectrum lies far below its RMS."""
    random, pole = np.random.default_rng(3), np.exp(-2 * np.pi * 5.0 * 1e-2)
    noise = lfilter([1.0], [1.0, -pole], random.normal(0, 3e-3 * np.sqrt(1 - pole**2), len(T)))
    still = (T % 10.0) > 5.0
    moving = np.where(still, 0.0, 1.0) * np.sin(2 * np.pi * 0.2 * T)
    assert noise_floor(T, moving + noise).rms < 2.2e-3
    found = noise_floor(T, moving + noise, still)
    assert found.rms == pytest.approx(3e-3, rel=0.25)
    assert found.how == "standstill"


def test_noise_is_drawn_from_the_calmest_standstills() -> None:
    """Four windows of noise, and four in which the drive still swings a hundred times as much."""
    t = np.arange(0.0, 4.0, 2e-3)
    noise = np.random.default_rng(5).normal(0.0, 1e-3, len(t))
    swing = np.where(t > 2.0, 0.1 * np.sin(2 * np.pi * 3.0 * t), 0.0)
    still = np.ones(len(t), dtype=bool)
    drawn = like_noise(t, noise + swing, still, np.random.default_rng(6))
    assert np.std(drawn) == pytest.approx(1e-3, rel=0.15)


def test_a_standstill_rounded_to_one_step_hides_its_noise() -> None:
    """It reads the same number all along, and yet the channel is no better than its steps."""
    t = np.arange(0.0, 8.0, 2e-3)
    step, still = 1e-3, (t % 2.0) < 1.0
    path = np.cumsum(np.where(still, 0.0, 2e-3 * np.sin(np.pi * (t % 1.0)) ** 2)) * 0.3
    drawn = like_noise(t, step * np.round(path / step), still, np.random.default_rng(9))
    assert np.std(drawn) == pytest.approx(step / np.sqrt(12.0), rel=0.5)


def test_two_short_standstills_tell_the_colour_of_noise() -> None:
    """A slow noise of corner 5 Hz, a record that stands twice for 0.3 s: neighbours are alike."""
    t = np.arange(0.0, 4.0, 2e-3)
    pole = np.exp(-2 * np.pi * 5.0 * 2e-3)
    noise = lfilter([1.0], [1.0, -pole], np.random.default_rng(7).normal(0.0, 1e-3, len(t)))
    still = ((t > 0.1) & (t < 0.4)) | ((t > 2.1) & (t < 2.4))
    drawn = like_noise(t, noise, still, np.random.default_rng(8))
    assert np.corrcoef(drawn[1:], drawn[:-1])[0, 1] > 0.6


def test_standing_waits_for_the_machine_to_settle() -> None:
    reference = np.where(T < 10.0, T, 10.0)
    still = standing(T, reference)
    assert not still[T < 10.4].any()
    assert still[T > 10.6].all()


def test_excess_is_the_ratio_of_rms_under_a_condition_and_everywhere() -> None:
    """Residual 3 where the table runs backwards, 1 elsewhere: sqrt(9 / mean of squares)."""
    speed = np.where(T < 10.0, 1.0, -1.0)
    square = np.where(speed < 0, 9.0, 1.0)
    found = {c.condition: c for c in where_it_fails([Situation("r", T, square, speed, {})])}
    mean = np.mean(square)
    assert found["backward"].excess == pytest.approx(np.sqrt(9.0 / mean))
    assert found["forward"].excess == pytest.approx(np.sqrt(1.0 / mean))
    assert found["backward"].time == pytest.approx(0.75, abs=1e-3)
    assert found["backward"].square == pytest.approx(9.0 * 0.75 / mean, rel=1e-3)


def test_flanks_are_told_apart() -> None:
    front, back, gap = np.ones(len(T)), -np.ones(len(T)), np.zeros(len(T))
    second = np.where(T < 10, back, np.where(T < 20, gap, front))
    square = np.where(T < 10, 1.0, np.where(T < 20, 4.0, 9.0))
    flanks = {"mesh_1": front, "mesh_2": second}
    found = {
        c.condition: c.excess
        for c in where_it_fails([Situation("r", T, square, np.ones(len(T)), flanks)])
    }
    mean = np.sqrt(np.mean(square))
    assert found["mesh_1 and mesh_2 braced"] == pytest.approx(1.0 / mean)
    assert found["a flank open"] == pytest.approx(2.0 / mean)
    assert found["mesh_1 and mesh_2 on one side"] == pytest.approx(3.0 / mean)
