"""How often residuals count themselves where a likelihood is conditioned on the first samples."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dualdrive.innovations import Point, Variant, inflation
from dualdrive.innovations.prediction import GIVEN
from test_innovations import bench

STRETCHES, SAMPLES, CHANNELS = 12, 500, 5

Array = NDArray[np.float64]


def innovations(times: float) -> Array:
    """White ones of so many times their variance, nought where a stretch begins."""
    random = np.random.default_rng(5)
    r = np.sqrt(times) * random.normal(size=(STRETCHES, SAMPLES, CHANNELS))
    r[:, :GIVEN] = 0.0
    whole: Array = r.reshape(-1, CHANNELS)
    return whole


@pytest.mark.parametrize("times", [1.5, 4.0])
def test_first_samples_of_stretches_are_no_residuals_of_nought(times: float) -> None:
    """A tenth of them on stretches of half a second."""
    whole = innovations(times)
    point = Point(Variant(bench()), np.zeros(0), (whole[:3000], whole[3000:]), 0.0, 0.0)
    assert inflation(point, [1]) == pytest.approx(times, rel=0.03)


def test_what_leaves_nothing_counts_once() -> None:
    nothing = np.zeros((SAMPLES, CHANNELS))
    assert inflation(Point(Variant(bench()), np.zeros(0), (nothing,), 0.0, 0.0)) == 1.0
