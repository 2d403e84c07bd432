"""Effects of motor, inverter and sensors in the loop, against the same done by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from core_machines import set_all
from dualdrive import Machine, MachineError, _core
from dualdrive.motion import move
from dualdrive.simulation import simulate

QUICK = move(0.3, v=1.5, a=5.0, j=50.0, end=0.4)
MOTOR = {"K_d": 0.3, "C_e": 0.3, "R": 2.0, "L": 6e-3, "T_rated": 1.2}


def lone_motor(locked: bool = False, **numbers: float) -> _core.Machine:
    core = _core.Machine()
    core.add_body("motor_1", locked)
    core.add_motor("motor_1")
    set_all(core, "motor_1", {"J": 1e-4, "b": 1e-4} | MOTOR | numbers)
    return core


def driven(core: _core.Machine, volts: float, end: float, **options: Any) -> _core.Trajectory:
    return _core.simulate(core, {"U_1": _core.constant(volts)}, end=end, **options)


def column(run: _core.Trajectory, name: str) -> Any:
    assert run.status == "success", run.message
    return run.values[:, run.names.index(name)]


def test_a_warm_motor_is_one_with_another_data_sheet() -> None:
    rise, loss = 60.0, 1.2e-3
    warm = lone_motor()
    set_all(warm, warm.add_effect("thermal_drift", "motor_1"), {"rise": rise, "flux_loss": loss})
    flux = 1 - loss * rise
    sheet = lone_motor(R=2.0 * (1 + 0.00393 * rise), K_d=0.3 * flux, C_e=0.3 * flux)
    for name in ("omega_1", "I_1"):
        here, there = (column(driven(core, 24.0, 0.2), name) for core in (warm, sheet))
        np.testing.assert_allclose(here, there, rtol=1e-10, atol=1e-12)
    told = column(driven(warm, 24.0, 0.2), "T_1")  # the drive's own idea of it
    np.testing.assert_allclose(told, 0.3 * column(driven(warm, 24.0, 0.2), "I_1"))


def test_a_locked_motor_loses_the_dead_time() -> None:
    core = lone_motor(locked=True)
    set_all(core, core.add_effect("dead_time", "motor_1"), {"voltage": 1.5, "current": 0.4})
    for volts in (-10.0, 10.0, 2.0):
        current = column(driven(core, volts, 0.2), "I_1")[-1]
        assert 2.0 * current + 1.5 * np.tanh(current / 0.4) == pytest.approx(volts, abs=1e-6)


def test_energy_closes_with_every_motor_effect() -> None:
    machine = Machine.load("bench")
    machine.add("thermal_drift", "motors", rise=60)
    machine.add("dead_time", "motors", voltage=2.0)
    machine.add("torque_constant_saturation", "motors", loss=0.2)
    machine.add("torque_ripple", "motors", amplitude=0.05)
    run = simulate(machine, QUICK, rtol=1e-9)
    assert run.statistics["energy_error"] < 1e-6


def test_a_saturated_motor_in_the_balance() -> None:
    """J alpha against T / sqrt(1 + 2 s (T / T_rated)^2), and its derivative by s."""
    core = lone_motor(b=0.0)
    label = core.add_effect("torque_constant_saturation", "motor_1")
    s, torque = 0.3, np.array([0.6, -1.2, 2.4])
    core.set(f"{label}.loss", s)
    x = torque / 1.2
    true = torque / np.sqrt(1 + 2 * s * x**2)
    zeros = np.zeros(3)
    rows = {"theta_1": zeros, "omega_1": zeros, "alpha_1": true / 1e-4, "T_1": torque}
    found = _core.torque_balance(core, rows, [f"{label}.loss"])
    np.testing.assert_allclose(found["residual"][0], 0.0, atol=1e-12)
    by_hand = torque * x**2 * (1 + 2 * s * x**2) ** -1.5
    np.testing.assert_allclose(found["jacobian"][0, :, 0], by_hand, rtol=1e-12)
    np.testing.assert_allclose(found["effects"][0], true - torque, rtol=1e-12)


def test_saturation_needs_a_rating() -> None:
    core = lone_motor(T_rated=float("inf"))
    core.add_effect("torque_constant_saturation", "motor_1")
    with pytest.raises(ValueError, match=r"set motor_1\.T_rated"):
        core.signals()


def test_no_dead_time_without_a_circuit() -> None:
    core = _core.Machine()
    core.add_body("motor_1")
    core.add_motor("motor_1", kind="direct")
    for effect in ("dead_time", "thermal_drift"):
        with pytest.raises(ValueError, match="direct torque source without a circuit"):
            core.add_effect(effect, "motor_1")


def test_mismatched_drives_share_the_load_unevenly() -> None:
    """Equaliser at rest with integral action, w = 1/2: T_1 - (1 + error) T_2 = T_ten."""
    error, tension = 0.2, 0.12
    for load in (0.0, 6.0):
        machine = Machine.load("bench")
        machine.add("tension_mismatch", "motor_2", error=error)
        run = simulate(machine, move(1e-3, v=1.5, a=5.0, j=50.0, end=4.0), load=load)
        one, two = run["T_1"][-1], run["T_2"][-1]
        assert one - (1 + error) * two == pytest.approx(tension, rel=1e-4)
        # each pinion carries its share of the load, whatever the tension
        assert (one + two) * 10 * 4 == pytest.approx(load, abs=1e-4)


# --- sensors in the loop --------------------------------------------------------------------------


def test_the_table_follows_an_eccentric_disc() -> None:
    machine = Machine.load("bench")
    machine.add("encoder_eccentricity", "table", amplitude=1e-3, phase=0.4)
    run = simulate(machine, move(0.7, v=3.0, a=20.0, j=500.0, end=3.0))
    at_rest = run["theta_m"][-1]
    assert at_rest + 1e-3 * np.cos(at_rest + 0.4) == pytest.approx(0.7, abs=1e-7)
    np.testing.assert_allclose(
        run["sensed.table"], run["theta_m"] + 1e-3 * np.cos(run["theta_m"] + 0.4), atol=1e-15
    )


def test_a_speed_from_an_eccentric_disc() -> None:
    machine = Machine.load("bench")
    machine.add("encoder_eccentricity", "motor_1", amplitude=1e-2, phase=0.4)
    run = simulate(machine, QUICK)
    wrong = 1 - 1e-2 * np.sin(run["theta_1"] + 0.4)
    np.testing.assert_allclose(run["sensed.motor_1"], run["omega_1"] * wrong, atol=1e-12)


def test_a_sampled_position_loop_counts() -> None:
    machine = Machine.load("bench")
    step = 2e-4
    with pytest.raises(MachineError, match=r"set controller\.position_sample"):
        machine.add("quantisation", "table", step=step)
    machine.set("controller.position_sample", 1e-3)
    plain = simulate(machine, QUICK)
    machine.add("quantisation", "table", step=step)
    run = simulate(machine, QUICK)
    counts = run["sensed.table"] / step
    assert np.abs(counts - np.round(counts)).max() < 1e-6
    wander = np.abs(run["theta_m"] - plain["theta_m"]).max()
    assert 1e-8 < wander < 2 * step


def test_a_differenced_encoder_counts() -> None:
    machine = Machine.load("bench")
    step = 2 * np.pi / 4096
    with pytest.raises(MachineError, match=r"set controller\.speed_samples"):
        machine.add("quantisation", "motor_1", step=step)
    machine.set("controller.speed_sample", 5e-4)
    machine.set("controller.speed_samples", 4)
    machine.add("quantisation", "motor_1", step=step)
    run = simulate(machine, QUICK)
    counts = run.final_state["controller.encoder_1[0]"] / step
    assert counts == pytest.approx(round(counts), abs=1e-6)
    other = run.final_state["controller.encoder_2[0]"] / step
    assert abs(other - round(other)) > 1e-4  # that one has no steps


@pytest.mark.parametrize(
    ("effect", "place", "name", "value"),
    [
        ("thermal_drift", "motors", "rise", 40.0),
        ("dead_time", "motors", "voltage", 2.0),
        ("torque_constant_saturation", "motors", "loss", 0.3),
        ("tension_mismatch", "motor_2", "error", 0.1),
        ("encoder_eccentricity", "table", "amplitude", 1e-4),
        ("encoder_eccentricity", "motors", "amplitude", 1e-3),
    ],
)
def test_derivatives(effect: str, place: str, name: str, value: float) -> None:
    path = f"{effect}@{place}.{name}"

    def e(at: float, **options: Any) -> Any:
        machine = Machine.load("bench")
        machine.add(effect, place, **{name: at})
        return simulate(machine, QUICK, rtol=1e-11, engine="cvode", **options)

    slope = e(value, sensitivities=[path]).sensitivity("I_2", path)
    step = 1e-3 * value
    difference = (e(value + step)["I_2"] - e(value - step)["I_2"]) / (2 * step)
    assert np.abs(slope - difference).max() < 1e-3 * np.abs(difference).max()
