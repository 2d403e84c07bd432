"""Noise carried through a balance where filters cut the ends of two records off differently."""

from __future__ import annotations

import numpy as np
import pytest

from dualdrive.compare.comparing import _apart
from dualdrive.identify.result import Residual


def residual(begin: float, count: int, noise: float) -> Residual:
    """A slow course, and what noise changes in it."""
    t = begin + 0.004 * np.arange(count, dtype=np.float64)
    course = np.sin(t) + noise * np.sin(40.0 * t)
    return Residual(t, course, np.zeros(count, dtype=np.float64), np.ones(count, dtype=bool))


def test_samples_that_lie_elsewhere_tell_the_same_noise() -> None:
    plain = residual(0.1, 3298, 0.0)
    same, other = residual(0.1, 3298, 0.1), residual(0.111, 3292, 0.1)
    assert _apart(plain, other) == pytest.approx(_apart(plain, same), rel=0.02)


def test_where_nothing_lies_in_both_there_is_no_floor() -> None:
    assert np.isnan(_apart(residual(0.0, 10, 0.0), residual(1.0, 10, 0.1)))
