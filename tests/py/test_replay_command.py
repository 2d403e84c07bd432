"""A recorded command between its samples: smooth motions as cubics, ramps as straight lines."""

from __future__ import annotations

import numpy as np
import pytest

from dualdrive import motion
from dualdrive.replay.record import waveform

T = 1e-3 * np.arange(4000, dtype=np.float64)
MIDDLES = T[:-1] + 0.5e-3


@pytest.mark.parametrize("corner", [1.0, 1.0003, 1.0005])
@pytest.mark.parametrize("slope", [0.1, 1e-3])
def test_ramps_are_straight_between_samples(corner: float, slope: float) -> None:
    """However slow beside the fastest: a cubic swings about each corner, and so would its rate."""
    values = np.interp(T, [0.0, corner, 2.0, 2.5, 4.0], [0.0, 0.0, slope, -0.3, -0.3])
    command = waveform(T, values)
    straight = 0.5 * (values[1:] + values[:-1])
    np.testing.assert_allclose(command.value(MIDDLES), straight, rtol=0.0, atol=1e-12)
    assert np.max(np.abs(command.rate(MIDDLES))) <= np.max(np.abs(np.diff(values))) / 1e-3 + 1e-9


def test_smooth_moves_are_not() -> None:
    """Straight lines would be off by an eighth of acceleration times step squared."""
    move = motion.move(0.02, v=0.03, a=0.1, j=2.0, start=0.5).waveform
    command = waveform(T, np.asarray(move.value(T)))
    off = np.asarray(command.value(MIDDLES)) - np.asarray(move.value(MIDDLES))
    assert np.max(np.abs(off)) < 0.02 * 0.1 * 1e-6 / 8.0


def test_a_coarse_command_is_straight() -> None:
    values = np.round(np.sin(T) / 1e-5) * 1e-5
    command = waveform(T, values)
    straight = 0.5 * (values[1:] + values[:-1])
    np.testing.assert_allclose(command.value(MIDDLES), straight, rtol=0.0, atol=1e-12)
