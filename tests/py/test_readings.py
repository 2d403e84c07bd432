"""Laws of sensors taken back: against motions whose readings are known in closed form."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dualdrive import Machine, _core
from dualdrive.diagnose import whitening
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.evidence import evidence
from dualdrive.diagnose.refit import Fitter
from dualdrive.identify.readings import before_sensors, channel_of
from dualdrive.replay import core_of

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.generator import effects
from tests.blind.shown import ordered

Array = NDArray[np.float64]
T: Array = np.arange(0.0, 4.0, 8e-3)
RATE = 2 * np.pi * 0.7  # rad/s, of the motion
NAMES = ("theta_1", "omega_1", "alpha_1")


def motion(t: Array) -> list[Array]:
    """An angle and its derivatives."""
    turn, part = 3.0 * np.sin(RATE * t), 0.4 * np.cos(3.1 * RATE * t)
    rate = 3.0 * RATE * np.cos(RATE * t) - 1.24 * RATE * np.sin(3.1 * RATE * t)
    bend = -3.0 * RATE**2 * np.sin(RATE * t) - 0.4 * (3.1 * RATE) ** 2 * np.cos(3.1 * RATE * t)
    return [turn + part, rate, bend]


def with_effect(effect: str, place: str, **values: float) -> Any:
    core = Machine.load("bench").core.copy()
    label = core.add_effect(effect, place)
    for name, value in values.items():
        core.set(f"{label}.{name}", value)
    return core


@pytest.mark.parametrize("place", ["theta_1", "motor_1", "motors"])
def test_a_late_angle_is_what_it_was_that_much_earlier(place: str) -> None:
    late = 7.3e-3
    samples = {"t": T, **dict(zip(NAMES, motion(T - late), strict=True))}
    found = before_sensors(with_effect("sensor_delay", place, time=late), samples)
    inside = T[-1] - late > T
    for name, true in zip(NAMES, motion(T), strict=True):
        assert found[name][inside] == pytest.approx(true[inside], abs=2e-5 * np.ptp(true))


def test_a_late_current_is_a_late_torque() -> None:
    late = 3e-3
    samples = {"t": T, "T_2": np.sin(RATE * (T - late)), "T_1": np.cos(RATE * T)}
    found = before_sensors(with_effect("sensor_delay", "I_2", time=late), samples)
    assert found["T_2"][:-1] == pytest.approx(np.sin(RATE * T[:-1]), abs=1e-5)
    assert found["T_1"] is samples["T_1"]


def test_no_sample_is_read_across_a_pause() -> None:
    t = np.concatenate([T, T + 100.0])
    step = np.concatenate([np.zeros(len(T)), np.full(len(T), 50.0)])
    core = with_effect("sensor_delay", "T_1", time=5e-3)
    assert np.array_equal(before_sensors(core, {"t": t, "T_1": step})["T_1"], step)


@pytest.mark.parametrize("amplitude", [0.05, 0.98])
def test_an_eccentric_disc_is_centred(amplitude: float) -> None:
    phase = 0.8
    angle, rate, bend = motion(T)
    reading = [
        angle + amplitude * np.cos(angle + phase),
        rate * (1.0 - amplitude * np.sin(angle + phase)),
        bend * (1.0 - amplitude * np.sin(angle + phase))
        - amplitude * np.cos(angle + phase) * rate**2,
    ]
    core = with_effect("encoder_eccentricity", "motor_1", amplitude=amplitude, phase=phase)
    found = before_sensors(core, dict(zip(NAMES, reading, strict=True)))
    for name, true in zip(NAMES, (angle, rate, bend), strict=True):
        assert found[name] == pytest.approx(true, rel=1e-10, abs=1e-10)


def test_a_disc_centred_off_its_track_is_refused() -> None:
    core = with_effect("encoder_eccentricity", "motor_1", amplitude=1.5)
    with pytest.raises(ValueError, match=r"@motor_1: .* does not grow with the angle"):
        before_sensors(core, dict(zip(NAMES, motion(T), strict=True)))


def test_an_effect_that_is_not_there_is_refused_with_its_nearest() -> None:
    core = with_effect("encoder_eccentricity", "motor_1", amplitude=0.01)
    with pytest.raises(ValueError, match=r"not in this machine.*eccentricity@motor_1"):
        _core.delay_of(core, "encoder_eccentricity@motor_2")


def test_what_was_not_recorded_was_not_misread() -> None:
    samples = {"t": T, "T_1": T}
    found = before_sensors(with_effect("encoder_eccentricity", "table", amplitude=0.01), samples)
    assert found == samples


def test_which_sensor_stands_at_a_body() -> None:
    read = {"table": "theta_m", "motor_2": "theta_2", "pinion_1": "theta_c1", "I_1": "T_1"}
    assert {member: channel_of(member) for member in read} == read
    assert channel_of("theta_1") == "theta_1"


@pytest.mark.long
def test_a_balance_closes_once_a_late_encoder_is_counted() -> None:
    """The other program reads one motor's encoder late, on a machine whose sheet is exact."""
    order = ordered.hiding("viscous", "bench", 0, 1.0, count=1)
    setting = effects.Setting(order.real, 1.0, 1.0, 1.0, 1.0, 1.0, 1e-3)
    late = next(
        one
        for one in (effects.draw("sensor_delay", setting, k, 0.5) for k in range(60))
        if one.place == "motor_1"
    )
    hidden = {plan.name: (late,) for plan in order.plans}
    real = replace(order, sheet=order.real, hidden=hidden)
    core = core_of(real.machine())
    grown = core.copy()
    grown.set(grown.add_effect("sensor_delay", "motor_1") + ".time", late.parameters["time"])

    def left(machine: object) -> float:
        """Worst of the drive's own equation, over its floor, numbers refitted."""
        c = TorqueBalance(machine, real.traces(), real.settings())
        first = c.left(c.core, c.start)
        assert first is not None
        own = Fitter(evidence(c, whitening.sized(c.series, first))).nominal(c.start)
        assert own is not None
        pairs = zip(own.left, c.series, strict=True)
        return float(max(np.std(r[s.keep]) / s.floor for r, s in pairs if s.name == "c1"))

    assert left(core) > 5.0
    assert left(grown) < 5.0
