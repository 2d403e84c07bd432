"""The input signals of the core as Python sees them: what goes in, what comes out."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from dualdrive import _core


def test_a_float_gives_a_float_and_an_array_its_own_shape() -> None:
    wave = _core.sine(2.0, 0.25)
    assert wave.value(1.0) == pytest.approx(2.0)
    assert isinstance(wave.value(1), float)
    assert isinstance(wave.value(np.float64(1.0)), float)
    times = np.arange(6).reshape(2, 3)  # integers too
    values = wave.value(times)
    assert isinstance(values, np.ndarray)
    assert values.shape == (2, 3)
    np.testing.assert_allclose(values, 2.0 * np.sin(0.5 * np.pi * times), atol=1e-14)
    np.testing.assert_allclose(wave.rate([0.0, 1.0]), [np.pi, 0.0], atol=1e-14)
    assert wave.acceleration(times[:, ::2]).shape == (2, 2)
    assert wave.value([]).shape == (0,)


def test_a_move_lasts_as_the_textbook_says() -> None:
    move = _core.jerk_limited_move(
        1.0, speed=0.5, acceleration=1.0, jerk=10.0, start=3.0, from_=2.0
    )
    assert move.end() == pytest.approx(3.0 + 1.0 / 0.5 + 0.5 / 1.0 + 1.0 / 10.0)
    assert move.value(move.end()) == 3.0
    assert move.breaks().size == 0
    assert move.knots().size == 8
    assert _core.jerk_limited_move(1.0, 0.5, 1.0, math.inf).breaks().size == 4


def test_a_bidirectional_cycle() -> None:
    targets = _core.bidirectional_targets([0.0, 1.0], 0.1)
    np.testing.assert_array_equal(targets, [-0.1, 0.0, 1.0, 1.1, 1.0, 0.0])
    limits = {"speed": 1.0, "acceleration": 2.0, "jerk": 20.0}
    cycle = _core.cycle_of_moves(targets, **limits, dwell=0.5, repeats=5)
    dwells = _core.dwells_of_cycle(targets, **limits, dwell=0.5, repeats=5)
    assert dwells.shape == (30, 3)
    np.testing.assert_array_equal(cycle.value(dwells[:, 1]), np.tile(targets, 5))
    np.testing.assert_allclose(dwells[:, 2] - dwells[:, 1], 0.5)
    assert cycle.end() == dwells[-1, 2]


def test_recordings_and_polynomials_agree_with_scipy() -> None:
    interpolate = pytest.importorskip("scipy.interpolate")
    random = np.random.default_rng(3)
    times = np.cumsum(random.uniform(0.01, 0.3, 60))
    values = random.normal(size=60)
    inside = np.linspace(times[0], times[-1], 500)[1:-1]
    spline = interpolate.CubicSpline(times, values, bc_type="not-a-knot")
    ours = _core.sampled(times, values)
    np.testing.assert_allclose(ours.value(inside), spline(inside), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ours.acceleration(inside), spline(inside, 2), rtol=1e-7, atol=1e-6)
    linear = _core.sampled(times, values, _core.Interpolation.linear)
    np.testing.assert_allclose(linear.value(inside), np.interp(inside, times, values), atol=1e-12)

    rows = np.vstack([np.zeros(4), spline.c[::-1].T, [values[-1], 0.0, 0.0, 0.0]])
    np.testing.assert_allclose(
        _core.Waveform(times, rows).value(inside), spline(inside), atol=1e-12
    )


def test_sums_and_factors() -> None:
    step = _core.step(1.0, at=2.0)
    both = 2.0 * step + _core.constant(3.0) * 0.5
    np.testing.assert_array_equal(both.value([1.0, 2.0]), [1.5, 3.5])
    assert _core.sum([step, step, step]).value(5.0) == 3.0
    assert _core.scale(step, -1.0).value(5.0) == -1.0
    assert _core.shift(step, 1.5).breaks().tolist() == [3.5]
    assert _core.odd_multisine(1.0, 0.5, 10, seed=3, from_zero=True).value(0.0) == pytest.approx(
        0.0, abs=1e-15
    )
    assert _core.multisine([1.0], [0.25], [0.0]).value(1.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (lambda: _core.step(math.nan), "step: height = nan is not a finite number"),
        (
            lambda: _core.jerk_limited_move(1, 1, math.inf, 1),
            "acceleration = inf must be a positive number",
        ),
        (
            lambda: _core.sampled([0.0, 1.0, 1.0], [0, 0, 0]),
            r"times\[2\] = 1 does not lie above times\[1\] = 1",
        ),
        (lambda: _core.sampled([[0.0, 1.0]], [0, 0]), "times must be one-dimensional"),
        (lambda: _core.Waveform([0.0], np.zeros((2, 7))), "1 to 6 columns"),
        (lambda: _core.Waveform([0.0], np.zeros((3, 2))), "3 pieces for 1 knots"),
        (lambda: _core.step(1.0) * math.inf, "factor = inf"),
        (lambda: _core.step(1.0).value("soon"), "soon"),
    ],
)
def test_bad_input_is_refused_by_name(action: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        action()
