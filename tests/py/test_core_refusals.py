"""The core refuses settings and inputs that no law would read, instead of computing without."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dualdrive
from dualdrive import _core


def heavy(**settings: Any) -> _core.Machine:
    core = dualdrive.Machine.load("heavy-table-100t").core
    for path, value in settings.items():
        core.set(path.replace("__", "."), value)
    return core


def run(core: _core.Machine, **options: Any) -> _core.Trajectory:
    inputs = {"theta_ref": _core.constant(0.0)} | options.pop("inputs", {})
    return _core.simulate(core, inputs, **({"end": 0.01} | options))


def test_a_position_loop_needs_a_table_to_read() -> None:
    core = _core.Machine()
    core.add_body("motor_1")
    core.add_motor("motor_1", kind="direct")
    core.set_controller()
    with pytest.raises(ValueError, match="no body named table"):
        run(core)


@pytest.mark.parametrize(
    ("settings", "rule"),
    [
        ({"K_d": 0.5, "tau_d": 1e-3, "position_sample": 2e-3}, "controller.tau_d"),
        ({"tau_t": 1e-3, "tension_sample": 5e-3}, "controller.tau_t"),
    ],
)
def test_a_filter_is_sampled_fast_enough_to_be_stable(
    settings: dict[str, float], rule: str
) -> None:
    core = heavy(**{f"controller__{name}": value for name, value in settings.items()})
    with pytest.raises(ValueError, match=rule):
        run(core)


def test_a_differenced_encoder_has_no_speed_sensor() -> None:
    core = heavy(controller__speed_sample=1e-3)
    core.add_effect("sensor_delay", "motors")
    run(core)
    core.set_controller(speed_samples=2)
    with pytest.raises(ValueError, match="differences the encoder of motor_1"):
        run(core)


def test_a_number_that_nothing_reads_is_refused() -> None:
    machine = dualdrive.Machine.load("heavy-table-100t")
    for path, why in (("gearboxes.gap", "is rigid"), ("meshes.preload", "has play")):
        old = machine.get(path)
        with pytest.raises(dualdrive.MachineError, match=why):
            machine.set(path, 1e-3)
        assert machine.get(path) == old
    machine.set("meshes.gap", 1e-3)
    assert machine.core.unread("meshes.gap") == ""


def test_a_balance_takes_the_flank_from_the_deflection_and_never_pulls() -> None:
    core = _core.Machine()
    core.add_body("pinion_1")
    core.add_body("table")
    core.connect("mesh_1", "pinion_1", "table", "gap", "driver")
    core.add_motor("motor_1", body="pinion_1", kind="direct")
    for path, value in {"mesh_1.gap": 1e-3, "mesh_1.stiffness": 1e6}.items():
        core.set(path, value)
    damping = core.add_effect("mesh_damping", "mesh_1")
    core.set(f"{damping}.coefficient", 1e5)
    rows = [-2e-3, 0.0, 2e-3, 2e-3]
    rates = [
        0.0,
        0.0,
        0.0,
        -0.1,
    ]  # the last parts so fast that its damper would pull: 1 kN·m − 10 kN·m
    zeros = np.zeros(4)
    channels = {
        "t": np.arange(4.0), "theta_c1": np.array(rows), "omega_c1": np.array(rates),
        "alpha_c1": zeros, "theta_m": zeros, "omega_m": zeros, "alpha_m": zeros, "T_1": zeros,
    }  # fmt: skip
    found = _core.torque_balance(core, channels)
    pinion = found["residual"][found["equations"].index("c1")]
    np.testing.assert_allclose(pinion, [-1000.0, 0.0, 1000.0, 0.0], atol=1e-9)
    eccentric = core.add_effect("eccentricity", "pinion_1")
    core.set(f"{eccentric}.amplitude", 1.5e-3)  # cos(0) at these angles, to 2e-6
    pinion = _core.torque_balance(core, channels)["residual"][found["equations"].index("c1")]
    expected = [0.0, 1e6 * 0.5e-3, 1e6 * 2.5e-3, 0.0]
    np.testing.assert_allclose(pinion, expected, rtol=0.01, atol=10.0)


def test_a_balance_refuses_friction_with_memory() -> None:
    core = _core.Machine()
    core.add_body("table")
    core.add_motor("motor_1", body="table", kind="direct")
    core.add_effect("lugre", "table")
    one = np.ones(3)
    channels = {"theta_m": one, "omega_m": one, "alpha_m": one, "T_1": one}
    with pytest.raises(ValueError, match="lugre@table keeps a state of its own"):
        _core.torque_balance(core, channels)


@pytest.mark.parametrize("step", [-1.0, float("nan")])
def test_the_longest_step_is_a_length(step: float) -> None:
    with pytest.raises(ValueError, match="longest_step"):
        run(heavy(), longest_step=step)


@pytest.mark.parametrize("name", ["T_laod", "U_1", "T_1", "temperature"])
def test_an_input_that_nothing_reads_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"input {name} is read by nothing"):
        run(heavy(), inputs={name: _core.constant(1.0)})


def test_an_input_that_a_formula_reads_is_taken() -> None:
    core = heavy()
    core.add_expression("table", "-0.1 * temperature")
    run(core, inputs={"temperature": _core.constant(1.0)})


@pytest.mark.parametrize("path", ["K_i", "K_d", "delta_t", "T_N", "T_E", "tau_t", "g_E"])
def test_no_derivative_by_what_zero_switches_off(path: str) -> None:
    """Finite differences of K_i or delta_t at 0 are not 0, as an absent state would have it."""
    core = heavy(**{f"controller__{path}": 0.0})
    with pytest.raises(ValueError, match=f"at 0 controller.{path} is switched off"):
        run(core, sensitivities=[f"controller.{path}"])


# --- units of formulas ----------------------------------------------------------------------------


def test_a_formula_that_is_no_torque_is_refused() -> None:
    machine = dualdrive.Machine.load("bench")
    with pytest.raises(dualdrive.MachineError, match="not a torque in N"):
        machine.add("expression", "table", formula="theta_m", parameters={})
    with pytest.raises(dualdrive.MachineError, match=r"omega_m"):
        machine.add(
            "expression",
            "table",
            formula="c * omega_m + T_1 * speed",
            parameters={"c": "2 N*m*s/rad"},
        )


def test_a_formula_in_coherent_units_is_taken() -> None:
    machine = dualdrive.Machine.load("bench")
    label = machine.add(
        "expression", "table", formula="-c * speed * abs(speed)", parameters={"c": "2 N*m*s^2"}
    )
    assert machine.get(f"{label}.c") == 2.0


def test_effects_without_a_torque_of_their_own_show_none() -> None:
    machine = dualdrive.Machine.load("heavy-table-100t")
    machine.add("sensor_offset", "theta_m", value=1e-6)
    names = {name for name, _, _ in machine.core.signals()}
    assert "coulomb@table" in names
    assert not names & {"sensor_offset@theta_m", "mesh_damping@meshes"}


def test_a_refused_formula_leaves_the_machine_as_it_was() -> None:
    core = heavy()
    before = [e["label"] for e in core.effects]
    numbers = [("a", "N*m*s/rad", 1.0), ("c", "N*m", float("nan"))]
    with pytest.raises(ValueError, match="parameter c is not finite"):
        core.add_expression("table", "a*speed + c", numbers)
    assert [e["label"] for e in core.effects] == before
    core.validate()
    assert run(core).status == "success"
