"""The linear algebra and the noise models of the diagnosis, against plain NumPy and known noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dualdrive.compare import evened
from dualdrive.diagnose import whitening
from dualdrive.diagnose.confront import Series
from dualdrive.diagnose.score import Rows, Scorer, alike
from dualdrive.traces import Trace

rng = np.random.default_rng(7)


def rows(n: int = 600, m: int = 4, sigma: float = 0.3) -> Rows:
    own = rng.normal(size=(n, m))
    return Rows(rng.normal(size=n), own, np.full(m, 0.2), np.full(m, sigma))


def test_a_gain_is_the_fall_of_the_penalised_sum_of_squares() -> None:
    r = rows()
    column = rng.normal(size=(600, 2))
    found = Scorer(r)(column)

    def least(design: np.ndarray) -> float:
        k = design.shape[1] - 4
        penalty = np.hstack([np.diag(1 / r.sigma), np.zeros((4, k))])
        whole = np.vstack([design, penalty])
        target = np.concatenate([-r.left, r.pull])
        step, *_ = np.linalg.lstsq(whole, target, rcond=None)
        return float(np.sum((whole @ step - target) ** 2))

    expected = least(r.slopes) - least(np.hstack([r.slopes, column]))
    assert found.gain == pytest.approx(expected, rel=1e-6)


def test_what_a_drifted_number_does_is_no_effect() -> None:
    """A residual that a nominal number can make, within its prior, gains nothing for its twin."""
    r = rows(sigma=10.0)
    signature = r.slopes[:, :1]
    made = Rows(5.0 * signature[:, 0], r.slopes, np.zeros(4), r.sigma)
    assert Scorer(made)(signature.copy()).gain < 0.01 * float(made.left @ made.left)


def test_spans_that_are_one_are_told() -> None:
    a = rng.normal(size=(300, 2))
    assert alike(a, a @ np.array([[1.0, 2.0], [0.5, -1.0]])) == pytest.approx(1.0)
    assert alike(a, rng.normal(size=(300, 2))) < 0.2


def series(noise: np.ndarray, rate: np.ndarray, floor: float) -> Series:
    n = len(noise)
    t = 1e-3 * np.arange(n, dtype=np.float64)
    every = np.ones(n, dtype=bool)
    return Series("r", "total", t, noise, floor, rate, every)


def test_coloured_noise_is_white_afterwards() -> None:
    n = 8000
    driven = rng.normal(size=n)
    noise = np.zeros(n)
    for k in range(1, n):
        noise[k] = 0.9 * noise[k - 1] + driven[k]
    s = series(noise, np.zeros(n), float(np.std(noise)))
    [w] = whitening.fitted([s], [noise])
    white = w(noise)[w.keep]
    assert np.std(white) == pytest.approx(1.0, abs=0.03)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.05


def test_noise_that_grows_with_speed_is_weighed_down_there() -> None:
    n = 20000
    rate = np.abs(np.sin(np.linspace(0, 40, n)))
    noise = rng.normal(size=n) * np.sqrt(1.0 + (3.0 * rate) ** 2)
    [w] = whitening.fitted([series(noise, rate, 1.0)], [noise])
    white = w(noise)
    fast, slow = (white[(rate > 0.9) & w.keep], white[(rate < 0.2) & w.keep])
    assert np.std(fast) / np.std(slow) == pytest.approx(1.0, abs=0.2)


def test_a_pause_starts_a_new_stretch() -> None:
    noise = rng.normal(size=1000)
    s = series(noise, np.zeros(1000), 1.0)
    t = s.t.copy()
    t[500:] += 1.0
    broken = replace(s, t=t)
    [w] = whitening.fitted([broken], [noise])
    top = max(whitening.ORDERS)
    assert not w.keep[500 : 500 + top].any()
    assert w.keep[500 + top :].all()


@pytest.mark.parametrize("even", [True, False])
def test_which_clock_was_even_is_read_off_the_motion(even: bool) -> None:
    """Samples taken evenly and stamped late, or taken at the very times of their stamps."""
    t = 2e-3 * np.arange(2000)
    jittered = t + rng.normal(scale=3e-5, size=2000)
    taken = t if even else jittered
    trace = Trace(jittered, {"theta_ref": np.sin(3.0 * taken)})
    found, size = evened(trace)
    if even:
        assert np.allclose(found.t, t, atol=1e-5)
        assert size == pytest.approx(3e-5, rel=0.1)
    else:
        assert found is trace
        assert size == 0.0


def test_where_the_motion_does_not_tell_the_clock_is_even() -> None:
    t = 1e-3 * np.arange(4000)
    jittered = t + rng.normal(scale=2e-6, size=4000)
    rounded = np.round(1e4 * np.sin(0.1 * t)) / 1e4  # its own steps hide what stamps would do
    found, size = evened(Trace(jittered, {"theta_ref": rounded}))
    assert size == pytest.approx(2e-6, rel=0.1)
    assert np.ptp(np.diff(found.t)) < 1e-12


@pytest.mark.parametrize("rate", [500.0, 2048.0, 501.37])
def test_a_rate_is_taken_as_set_unless_the_stamps_tell_it_apart(rate: float) -> None:
    """To rounding where it is round hertz to four digits; as fitted where it is not."""
    t = np.arange(4000) / rate
    jittered = t + rng.normal(scale=1e-5, size=4000)
    found, _ = evened(Trace(jittered, {"theta_ref": np.sin(3.0 * t)}))
    off = abs(found.t[-1] - t[-1])
    assert off < 1e-12 if rate != 501.37 else off < 2e-6
    assert found.t[0] == 0.0
