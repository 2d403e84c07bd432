"""Limiters that slide along their limit, replayed: against the engines; slopes through rides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from dualdrive import _core
from dualdrive.linear.small_signal import push
from test_innovations import (
    CHANNELS,
    REVERSALS,
    SENSORS,
    STEP,
    bench,
    coloured,
    predicted,
    record,
)
from test_sensitivities import TORQUE, apart

Array = NDArray[np.float64]

SWAYING = {"theta_ref": _core.sine(0.1, 1.0)}
SAMPLES = 2000


def machine(
    effects: Mapping[str, Mapping[str, float]] | None = None,
    loops: Mapping[str, float] | None = None,
) -> Any:
    """Without play, and its motors too weak for the command."""
    core = bench(effects, gap=0.0)
    core.set("motors.T_max", 0.05)
    for name, period in (loops or {}).items():
        core.set(f"controller.{name}", period)
    return core


def simulated(
    core: Any, inputs: Mapping[str, Any] = SWAYING, samples: int = SAMPLES
) -> tuple[Array, list[Any]]:
    """Signals at the samples, and the switches of limiters, by the engine."""
    times = STEP * np.arange(samples)
    found = _core.simulate(core, inputs, end=times[-1], times=list(times), signals=list(CHANNELS))
    events = [e for e in found.events if e[1].startswith("controller")]
    return np.column_stack([found.values[:, found.names.index(c)] for c in CHANNELS]), events


def rides(events: list[Any]) -> set[str]:
    """Which limiters began one."""
    return {name for _, name, _, mode in events if mode.startswith("riding")}


@pytest.mark.parametrize(
    ("effects", "loops", "inputs", "error"),
    [
        ({}, {}, SWAYING, 2e-7),
        # no law of the control's: between samples it feels the plant alone
        ({"torque_ripple@motors": {"amplitude": 0.03}}, {}, SWAYING, 2e-5),
        ({"encoder_eccentricity@table": {"amplitude": 1e-3}}, {}, SWAYING, 5e-7),
        ({"transport_delay@controller": {"delta_c": 2e-3}}, {}, {"theta_ref": REVERSALS}, 2e-5),
        # what is not sampled rides between ticks
        ({}, {"position_sample": 2e-3}, SWAYING, 2e-4),
    ],
    ids=["affine", "ripple", "encoder", "late command", "beside ticks"],
)
def test_without_unknown_torque_it_is_a_simulation(
    effects: dict[str, dict[str, float]],
    loops: dict[str, float],
    inputs: dict[str, Any],
    error: float,
) -> None:
    core = machine(effects, loops)
    truth, events = simulated(core, inputs)
    assert rides(events)
    found = predicted(core, record(inputs, truth), {}, states=True)
    off = np.sqrt(np.mean(found["innovations"] ** 2, axis=0)) / np.std(truth, axis=0)
    assert np.max(off) < error
    assert found["switches"] < len(events) + 5, "it does not chatter"


def test_where_both_drives_are_saturated_an_equaliser_s_ride_stands() -> None:
    """Nothing turns its input but rounding, which had it saturate and ride again without end."""
    core, inputs = machine(), {"theta_ref": _core.sine(0.1, 1.0, phase=-np.pi / 2, offset=0.1)}
    truth, events = simulated(core, inputs)
    assert "controller.equaliser_2" in rides(events)
    found = predicted(core, record(inputs, truth), {})
    assert found["switches"] < len(events) + 5


def test_a_stretch_begins_amid_a_ride() -> None:
    """Its integrator is where the output's limit wants it, at every sample."""
    core = machine()
    truth, events = simulated(core)
    begin, end = (e[0] for e in events if e[1] == "controller.speed_1" and 1.4 < e[0] < 1.5)
    sample = round(0.5 * (begin + end) / STEP)
    whole = record(SWAYING, truth)
    found = predicted(core, whole, {}, states=True)
    begins = dict(zip(found["states"], map(float, found["trajectory"][sample]), strict=True))
    here = whole.stretches([(sample, 100)])
    assert np.max(predicted(core, here, {}, initial=[begins], given=0)["residuals"]) < 1e-4


def test_innovations_are_white_through_rides() -> None:
    """Mean square 1, under torque of unknown course; where it chattered, 6 at the encoders."""
    samples, random = 6000, np.random.default_rng(5)
    core, pushed = machine(), machine()
    name = push(pushed, "table")
    drive, memory = 1e-4, 0.99
    torque = lfilter([1.0], [1.0, -memory], drive * random.normal(size=samples))
    held = _core.sampled(STEP * np.arange(samples), torque, _core.Interpolation.hold)
    truth, events = simulated(pushed, {**SWAYING, name: held}, samples)
    seen = record(SWAYING, truth + coloured(random, samples))
    found = predicted(core, seen, {"table": (drive, memory)})
    r = found["residuals"][500:]
    assert np.mean(r**2, axis=0) == pytest.approx(np.ones(r.shape[1]), abs=0.1)
    assert np.max(np.abs(r)) < 6.0
    assert found["switches"] < 1.1 * len(events), "the filter knows what became of the integrator"


def test_sampled_loops_ride_nowhere() -> None:
    core = machine()
    sampled = machine(loops=dict.fromkeys(("speed_sample", "tension_sample"), 1e-3))
    assert "controller.speed_1" in rides(simulated(core)[1])
    assert not rides(simulated(sampled)[1])


def slopes(core: Any, other: Any, torque: Mapping[str, Any]) -> tuple[Array | None, Array]:
    """By the recursion, and by a replay of the other machine; the record has noise in it."""
    truth, _ = simulated(core)
    seen = record(SWAYING, truth + coloured(np.random.default_rng(1), SAMPLES))
    held = _core.kalman_gains(core, seen, SENSORS, torque)
    now = _core.predict(core, seen, held, learn=True)["residuals"]
    after = _core.predict(other, seen, held)["residuals"]
    [told] = _core.sensitivities(core, seen, held, [(other, [], [])], at_any_cost=True)
    return told, after - now


@pytest.mark.parametrize("torque", [{}, TORQUE], ids=["simulated", "corrected"])
@pytest.mark.parametrize("path", ["motors.T_max", "table.J", "controller.T_N", "controller.K_v"])
def test_slopes_go_on_through_rides(path: str, torque: Mapping[str, Any]) -> None:
    core = machine()
    other = core.copy()
    other.set(path, core.get(path) * (1.0 + 1e-6))
    assert apart(*slopes(core, other, torque)) < 1e-2


@pytest.mark.parametrize(
    ("law", "numbers", "error"),
    [
        ("hydrostatic_drag@table", {"quadratic": 1e-4}, 5e-3),
        ("mesh_damping@meshes", {"coefficient": 1e-4}, 1e-3),
        ("position_dependent_inertia@table", {"amplitude": 1e-6}, 0.02),
    ],
)
def test_a_law_of_the_plant_s_beside_rides(
    law: str, numbers: dict[str, float], error: float
) -> None:
    assert apart(*slopes(machine(), machine({law: numbers}), TORQUE)) < error


def test_what_a_law_of_the_control_s_does_to_a_ride_is_not_told() -> None:
    law = {"encoder_eccentricity@table": {"amplitude": 1e-6}}
    assert slopes(machine(), machine(law), TORQUE)[0] is None
    assert slopes(bench(gap=0.0), bench(law, gap=0.0), TORQUE)[0] is not None
