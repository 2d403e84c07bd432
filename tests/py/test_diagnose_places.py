"""What the residual tells of an effect's order and spot, and how much it tells at all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from dualdrive.diagnose import whitening
from dualdrive.diagnose.confront import Series
from dualdrive.diagnose.evidence import Evidence, effective
from dualdrive.diagnose.heldout import intervals
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.orders import strongest_orders
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.spots import worst_spot

N = 4000
T = 1e-3 * np.arange(N, dtype=np.float64)
#: two turns forth and back, twice
ANGLE = 4 * np.pi * np.abs(((T / 1.0 + 0.5) % 2.0) - 1.0)


@dataclass
class Told:
    """As much of a confrontation as an evidence asks for: one series, and what was recorded."""

    series: list[Series]
    recorded: Mapping[str, np.ndarray]
    core: Any = field(default_factory=SimpleNamespace)

    def columns(self, k: int) -> Mapping[str, np.ndarray]:
        return self.recorded


def evidence(left: np.ndarray, **recorded: np.ndarray) -> Evidence:
    every = np.ones(N, dtype=bool)
    own = Series("r", "total", T, left, 1.0, np.zeros(N), every)
    told: Any = Told([own], recorded)
    return Evidence(told, whitening.plain([own]), np.zeros(N, dtype=np.intp))


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=N)


def test_a_ripple_that_grows_with_the_current_is_found_though_the_current_changes_sign() -> None:
    """Forth and back the current has two signs, so that over both the plain harmonic cancels."""
    current = np.sign(np.gradient(ANGLE)) * (1.0 + 0.1 * np.sin(3 * T))
    left = 0.3 * current * np.sin(6 * ANGLE + 0.4) + noise(1)
    seen = evidence(left, theta_1=ANGLE, I_1=current)
    [(order, gain)] = strongest_orders(seen, left, "motor_1", "torque")
    assert order == 6
    assert gain == pytest.approx(0.3**2 * N / 2, rel=0.3)  # amplitude^2 n / 2
    plain = dict(strongest_orders(seen, left, "motor_1"))
    assert plain.get(6, 0.0) < 0.5 * gain


def test_a_friction_that_turns_with_the_angle_is_carried_by_the_direction() -> None:
    left = 0.3 * np.sign(np.gradient(ANGLE)) * np.cos(3 * ANGLE) + noise(2)
    seen = evidence(left, theta_1=ANGLE)
    assert strongest_orders(seen, left, "motor_1", "direction")[0][0] == 3


def test_a_bump_is_found_where_it_sits() -> None:
    left = 2.0 * np.exp(-0.5 * ((ANGLE - 7.0) / 0.8) ** 2) + noise(3)
    spot = worst_spot(evidence(left, theta_1=ANGLE), left, "motor_1")
    assert spot is not None
    centre, width = spot
    assert centre == pytest.approx(7.0, abs=0.5)  # a grid of a twenty-fifth of the travel
    assert width == pytest.approx(0.8, rel=0.7)  # of widths a factor of two and a half apart


def test_noise_has_no_spot_and_no_order() -> None:
    left = noise(4)
    seen = evidence(left, theta_1=ANGLE, I_1=np.ones(N))
    assert worst_spot(seen, left, "motor_1") is None
    assert strongest_orders(seen, left, "motor_1", "torque") == []


def autoregression(a: float) -> np.ndarray:
    driven, found = noise(5), np.zeros(N)
    for k in range(1, N):
        found[k] = a * found[k - 1] + driven[k]
    return found


@pytest.mark.parametrize("a", [0.0, 0.8, 0.95])
def test_what_is_alike_from_sample_to_sample_counts_as_few(a: float) -> None:
    """The mean of an AR(1) of n samples is known as from n (1 - a) / (1 + a) independent ones."""
    left = autoregression(a)
    [own] = evidence(left).confrontation.series
    [w] = whitening.sized([own], [left])
    assert w.alike == pytest.approx((1 + a) / (1 - a), rel=0.3)
    white = w(left)
    assert float(white @ white) == pytest.approx(N / w.alike, rel=0.01)
    told: Any = Told([own], {})
    seen = Evidence(told, [w], np.zeros(N, dtype=np.intp))
    assert effective(white, seen) == pytest.approx(1.0, rel=1e-6)  # not counted twice
    assert seen.count == pytest.approx(N / w.alike, abs=1.0)


@dataclass
class Number:
    """A nominal number in its own unit."""

    path: str = "table.J"
    unit: str = "kg*m^2"
    logarithmic: bool = False

    def value(self, x: float) -> float:
        return x


def test_an_interval_covers_though_the_noise_is_alike_longer_than_it_was_taken_for() -> None:
    """A constant in noise that is alike for some twenty samples, taken for white: 95 % are wanted.

    Twelve blocks are few: about 90 % come out of their scatter, 35 % of the curvature alone.
    """
    draws, covered, generator = 200, 0, np.random.default_rng(6)
    every = np.ones(N, dtype=bool)
    white = whitening.Whitener(np.zeros(0), np.full(N, 1 / np.sqrt(1 - 0.9**2)), every)
    block = np.arange(N) * 12 // N
    for _ in range(draws):
        left = lfilter([1.0], [1.0, -0.9], generator.normal(size=N + 200))[200:]
        own = Series("r", "total", T, left, 1.0, np.zeros(N), every)
        told: Any = Told([own], {})
        told.nominal, told.sigma, told.centre = [Number()], np.array([np.inf]), np.zeros(1)
        mean = float(np.mean(left))
        fit = Refit(
            *(Hypothesis(), None, (), np.array([-mean]), np.zeros(0), [left - mean]),
            *([np.ones((N, 1))], [np.zeros((N, 0))], 0.0),
        )
        found = intervals(Evidence(told, [white], block), fit, 1.0)["table.J"]
        covered += found.low <= 0.0 <= found.high
    assert 0.8 <= covered / draws <= 0.99


@pytest.mark.parametrize(("shared", "factor"), [(0.0, 1.0), (1.0, np.sqrt(3.0))])
def test_noise_that_three_series_share_is_counted_once(shared: float, factor: float) -> None:
    """A constant in three series: of one noise it is known no better than from one of them."""
    generator, every = np.random.default_rng(8), np.ones(N, dtype=bool)
    white = whitening.Whitener(np.zeros(0), np.ones(N), every)
    one = generator.normal(size=N)
    lefts = [
        np.sqrt(shared) * one + np.sqrt(1.0 - shared) * generator.normal(size=N) for _ in range(3)
    ]
    lefts = [(x - np.mean(x)) / np.std(x) for x in lefts]
    names = ("total", "1", "2")
    own = [
        Series("r", name, T, x, 1.0, np.zeros(N), every)
        for name, x in zip(names, lefts, strict=True)
    ]
    told: Any = Told(own, {})
    told.nominal, told.sigma, told.centre = [Number()], np.array([np.inf]), np.zeros(1)
    fit = Refit(
        *(Hypothesis(), None, (), np.zeros(1), np.zeros(0), lefts),
        *([np.ones((N, 1)) for _ in names], [np.zeros((N, 0)) for _ in names], 0.0),
    )
    block = np.zeros(3 * N, dtype=np.intp)
    found = intervals(Evidence(told, [white] * 3, block), fit, 1.0)["table.J"]
    alone = 1.959964 / np.sqrt(3 * N)
    assert found.high - found.low == pytest.approx(2.0 * factor * alone, rel=0.05)
