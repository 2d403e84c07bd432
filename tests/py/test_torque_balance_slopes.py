"""Derivatives of a torque balance against plain differences of all that it leaves."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from dualdrive import _core
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.replay import core_of

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.shown import ordered

STEP = 1e-4


def test_numbers_are_the_same_with_slopes_and_without() -> None:
    order = ordered.hiding("cutting_torque", "bench", 0, 1.0)
    c = TorqueBalance(core_of(order.machine()), order.traces(), order.settings())
    for held in c.held:
        alone = _core.torque_balance(c.core, dict(held.samples))
        beside = _core.torque_balance(c.core, dict(held.samples), [p.path for p in c.nominal])
        assert alone["jacobian"].size == 0
        assert alone["residual"] == pytest.approx(beside["residual"], rel=1e-9, abs=1e-9)
        assert np.array_equal(alone["standstill"], beside["standstill"])


def test_every_nuisance_moves_its_own_series_as_differences_say() -> None:
    order = ordered.hiding("cutting_torque", "bench", 0, 1.0)
    c = TorqueBalance(core_of(order.machine()), order.traces(), order.settings())
    assert len(c.held) > 1
    assert min(len(c.zeros), len(c.constants), len(c.nominal)) > 1
    u = c.start + 0.01 * np.cos(np.arange(len(c.start)))
    u = np.clip(u, c.low, c.high - STEP)
    here, slopes = c.left(c.core, u), c.slopes(c.core, u)
    assert here is not None
    assert slopes is not None
    for j in range(len(u)):
        there = c.left(c.core, u + STEP * np.eye(len(u))[j])
        assert there is not None
        for a, b, own in zip(here, there, slopes, strict=True):
            size = max(1.0, float(np.max(np.abs(own[:, j]))))
            assert np.max(np.abs((b - a) / STEP - own[:, j])) < 1e-2 * size, j
    # a zero and a constant are of one record
    count = len(c.equations)
    for j, (record, *_) in enumerate([*c.zeros, *c.constants], len(c.nominal)):
        moved = {at // count for at, own in enumerate(slopes) if np.any(own[:, j])}
        assert moved == {record}
