"""Effects so strong that the machine without them is far away: noise and coordinates."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.shown import ordered

from dualdrive.diagnose import whitening
from dualdrive.diagnose.confront import Series
from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.profiled import profile
from dualdrive.replay import core_of


def test_the_profile_is_the_likelihood_at_the_best_size_of_the_noise() -> None:
    """n log of the mean square, every series by its own size, n those that are independent."""
    n, sizes, alike = 400, (2.0, 0.1), (1.0, 8.0)
    every, t = np.ones(n, dtype=bool), 1e-3 * np.arange(n, dtype=np.float64)
    series = [Series("r", k, t, t, 1.0, t, every) for k in ("total", "1")]
    told: Any = SimpleNamespace(series=series, sigma=np.array([0.5, np.inf]), centre=np.zeros(2))
    whiteners = [whitening.Whitener(np.zeros(0), np.full(n, 3.0), every, own) for own in alike]
    seen = Evidence(told, whiteners, np.zeros(2 * n, dtype=int))
    left = [size * np.where(t % 2e-3 < 1e-3, 1.0, -1.0) for size in sizes]
    refit = SimpleNamespace(u=np.array([1.0, 7.0]), left=left)
    expected = (1.0 / 0.5) ** 2
    expected += sum(n / own * math.log((s / 3.0) ** 2) for s, own in zip(sizes, alike, strict=True))
    assert profile(seen, refit) == pytest.approx(expected, rel=1e-12)  # type: ignore[arg-type]


@pytest.mark.parametrize("effect", ["shaft_compliance", "gearbox_backlash"])
def test_a_stiffness_put_in_is_fitted_as_the_compliance_that_it_adds(effect: str) -> None:
    core = core_of(ordered.drifted("bench", 0, 1.0).machine())
    h = Hypothesis(((effect, "gearboxes"),))
    grown, free = h.put_in(core)
    [p] = [p for p in h.unknowns(grown, free, {}) if p.path.endswith(".stiffness")]
    begin = float(grown.get(p.path))
    assert p.value(p.start) == pytest.approx(begin)
    assert p.value(2.0) == pytest.approx(begin / 2.0), "twice the compliance"
    assert p.coordinate(p.value(0.3)) == pytest.approx(0.3)
    slope = (p.value(1.0 + 1e-6) - p.value(1.0 - 1e-6)) / 2e-6
    assert p.slope(1.0) == pytest.approx(slope, rel=1e-6)
    low, high = p.bounds
    assert 0.0 < low < p.start < high
    assert p.value(0.0) == p.high, "rigid"


def test_a_number_open_at_zero_stays_above_it_however_far_a_step_goes() -> None:
    """A stiffness of bristles that nothing holds: a step of a thousand e-folds is no stiffness."""
    core = core_of(ordered.drifted("bench", 0, 1.0).machine())
    h = Hypothesis((("lugre", "table"),))
    grown, free = h.put_in(core, {"torque": 1.0, "speed": 1.0, "travel": 1.0})
    [p] = [p for p in h.unknowns(grown, free, {}) if p.path.endswith(".stiffness")]
    assert p.logarithmic, "else this shows nothing"
    for u in (-1000.0, 1000.0):
        assert 0.0 < p.value(u) < math.inf
        assert math.isfinite(p.slope(u))
        grown.set(p.path, p.value(u))
    assert p.value(0.5) == pytest.approx(p.scale * math.exp(0.5))
