"""Loops that tick, replayed a sample at a time: against the exact engine; slopes through ticks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dualdrive import _core
from test_innovations import CHANNELS, REVERSALS, SENSORS, STEP, bench, coloured
from test_sensitivities import apart, both

Array = NDArray[np.float64]

LOOPS: dict[str, dict[str, float]] = {
    "at every sample": {"speed_sample": 1e-3},
    "at every other": {"speed_sample": 1e-3, "position_sample": 2e-3, "tension_sample": 2e-3},
    "four a sample": {"speed_sample": 2.5e-4, "position_sample": 1e-3},
    "late": {"speed_sample": 1e-3, "speed_latency": 4e-4, "current_sample": 5e-4},
}


def machine(loops: str, effects: Mapping[str, Mapping[str, float]] | None = None) -> Any:
    core = bench(effects)
    for name, value in LOOPS[loops].items():
        core.set(f"controller.{name}", value)
    return core


def even(samples: int) -> Array:
    times: Array = STEP * np.arange(samples, dtype=np.float64)
    return times


def uneven(samples: int) -> Array:
    """Times of samples that are off by half a per cent of their distance, the first one not."""
    off = 5e-3 * STEP * np.random.default_rng(3).normal(size=samples)
    off[0] = 0.0
    times: Array = even(samples) + off
    return times


def measured(core: Any, times: Array) -> Array:
    """By the exact engine, shape (samples, channels)."""
    inputs = {"theta_ref": REVERSALS}
    found = _core.simulate(core, inputs, end=times[-1], times=list(times), signals=list(CHANNELS))
    return np.column_stack([found.values[:, found.names.index(c)] for c in CHANNELS])


def record(times: Array, values: Array) -> Any:
    channels = [(c, [c]) for c in CHANNELS]
    return _core.SampledRecord(
        {"theta_ref": REVERSALS}, times, channels, np.ascontiguousarray(values)
    )


@pytest.mark.parametrize("off", [False, True], ids=["even", "uneven"])
@pytest.mark.parametrize("loops", LOOPS)
@pytest.mark.parametrize(
    ("effects", "numbers", "error"),
    [
        ({}, {}, 2e-5),
        ({}, {"controller.T_ten": 0.0}, 2e-5),
        ({}, {"motors.T_max": 0.05, "controller.T_ten": 0.02}, 5e-5),
        ({"coulomb@table": {"torque": 0.5}}, {"controller.T_ten": 0.0}, 2e-5),
        ({"stribeck@table": {"torque": 0.5}}, {}, 5e-4),
        ({"torque_ripple@motors": {"amplitude": 0.03}}, {"controller.T_ten": 0.0}, 1e-3),
        ({"encoder_eccentricity@table": {"amplitude": 1e-3}}, {}, 2e-4),
    ],
    ids=["plain", "slack", "limited", "coulomb", "stribeck", "ripple", "encoder"],
)
def test_it_is_a_simulation(
    effects: dict[str, dict[str, float]],
    numbers: dict[str, float],
    error: float,
    loops: str,
    off: bool,
) -> None:
    """RMS, of each channel's own spread: what a law that is not affine adds is a parabola."""
    core = machine(loops, effects)
    for path, value in numbers.items():
        core.set(path, value)
    times = uneven(2000) if off else even(2000)
    truth = measured(core, times)
    here = record(times, truth)
    gains = _core.kalman_gains(core, here, SENSORS, {})
    found = _core.predict(core, here, gains, states=True)
    assert found["finite"]
    missed = np.sqrt(np.mean(found["innovations"] ** 2, axis=0)) / np.std(truth, axis=0)
    assert np.max(missed) < error


@pytest.mark.parametrize("loops", LOOPS)
@pytest.mark.parametrize("path", ["table.J", "motors.K_d", "meshes.stiffness", "controller.K_v"])
def test_a_number_that_moves(path: str, loops: str) -> None:
    """The controller's own ticks move with K_v; the others move what they read."""
    core = machine(loops)
    other = core.copy()
    other.set(path, core.get(path) * (1.0 + 1e-5))
    times = even(2000)
    values = measured(core, times) + coloured(np.random.default_rng(1), len(times))
    assert apart(*both(core, other, record(times, values))) < 2e-3


@pytest.mark.parametrize(
    ("numbers", "error"),
    [({"controller.T_ten": 0.0}, 2e-2), ({"motors.T_max": 0.05, "controller.T_ten": 0.02}, 2e-3)],
    ids=["flanks that part and meet", "ticks that meet a limit"],
)
@pytest.mark.parametrize("loops", LOOPS)
def test_through_what_changes_within_a_sample(
    loops: str, numbers: dict[str, float], error: float
) -> None:
    core = machine(loops)
    for path, value in numbers.items():
        core.set(path, value)
    other = core.copy()
    other.set("table.J", core.get("table.J") * (1.0 + 1e-6))
    times = even(2000)
    values = measured(core, times) + coloured(np.random.default_rng(1), len(times))
    assert apart(*both(core, other, record(times, values))) < error


def test_a_law_beside_loops_that_tick() -> None:
    """What it adds to rates is felt at samples, and pushes through the ticks between them."""
    core = machine("four a sample")
    other = machine("four a sample", {"hydrostatic_drag@table": {"quadratic": 1e-4}})
    times = even(2000)
    values = measured(core, times) + coloured(np.random.default_rng(1), len(times))
    assert apart(*both(core, other, record(times, values))) < 5e-3


def test_the_distance_of_uneven_times_is_that_of_their_clock() -> None:
    """Ticks repeat with the samples of the clock, not with the median of what it says."""
    times = uneven(2000)
    here = record(times, np.zeros((2000, len(CHANNELS))))
    assert here.step == pytest.approx(STEP, rel=1e-6)
    assert np.median(np.diff(times)) != pytest.approx(STEP, rel=1e-6)
