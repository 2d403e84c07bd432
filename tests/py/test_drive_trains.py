"""Every way of putting a machine together, against a closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dualdrive import Machine, MachineError, Run, parse_motion, simulate

PARTS = """
schema = 1
drive_train = "{train}"
{more}
[motors]
kind = "{motor}"
J = 0.01
K_d = 1.0
C_e = 1.0
R = 1.0
L = 1e-2

[gearboxes]
kind = "{gearbox}"
ratio = 10
stiffness = 4e3

[pinions]
J = 1.0

[meshes]
kind = "{mesh}"
ratio = 4
stiffness = 1e4
gap = 1e-3

[table]
J = 100.0
"""
I_G, I_M, J_D, J_C, J_M = 10.0, 4.0, 0.01, 1.0, 100.0


def train(
    name: str = "dual_servo",
    more: str = "",
    *,
    motor: str = "direct",
    gearbox: str = "rigid",
    mesh: str = "rigid",
    then: str = "",
) -> Machine:
    text = PARTS.format(train=name, more=more, motor=motor, gearbox=gearbox, mesh=mesh)
    return Machine.from_toml(text + then, "train")


def period(run: Run, name: str) -> float:
    """Mean time between rising zero crossings, found on the samples' straight lines."""
    t, x = run.t, run[name]
    k = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossings = t[k] - x[k] * (t[k + 1] - t[k]) / (x[k + 1] - x[k])
    return float(np.diff(crossings).mean())


@pytest.mark.parametrize("drives", [1, 2, 3])
def test_drives_on_a_rigid_ring_are_one_inertia(drives: int) -> None:
    m = train(more=f"drives = {drives}")
    run = simulate(m, end=1.0, load=-50.0, inputs={"T_1": 2.0})
    inertia = J_M + drives * I_M**2 * (I_G**2 * J_D + J_C)
    acceleration = (50.0 + 2.0 * I_G * I_M) / inertia
    assert run["omega_m"][-1] == pytest.approx(acceleration, rel=1e-9)
    assert run[f"omega_{drives}"][-1] == pytest.approx(acceleration * I_G * I_M, rel=1e-9)


def test_two_bodies_per_drive_swing_against_each_other() -> None:
    """Motor and pinion on the shaft between them, the mesh open: 2π / sqrt(K / J_r)."""
    m = train("single_motor", gearbox="compliant", mesh="gap")
    run = simulate(m, end=2.0, initial={"omega_1": 1e-4}, output_step=1e-4)
    motor = I_G**2 * J_D
    reduced = motor * J_C / (motor + J_C)
    expected = math.tau / math.sqrt(4e3 / reduced)
    assert run["mesh_1.torque"].any() == np.False_
    assert period(run, "gearbox_1.twist") == pytest.approx(expected, rel=1e-5)


def test_a_rigid_mesh_on_a_compliant_reducer() -> None:
    m = train("single_motor", gearbox="compliant", mesh="rigid", then="locked = true\n")
    run = simulate(m, end=2.0, initial={"omega_1": 1e-2}, output_step=1e-4)
    assert not run["theta_m"].any()
    assert period(run, "gearbox_1.twist") == pytest.approx(
        math.tau / math.sqrt(4e3 / (I_G**2 * J_D)), rel=1e-5
    )


def test_one_body_is_a_mass_under_a_force() -> None:
    m = Machine.from_toml(
        'schema = 1\naxis = "linear"\ndrive_train = "rigid"\n'
        '[motor_1]\nkind = "direct"\nJ = 0\n[mesh_1]\nratio = 1\n[table]\nJ = "80 kg"\n'
    )
    run = simulate(m, end=2.0, inputs={"T_1": 40.0})
    assert run["theta_m"][-1] == pytest.approx(0.5 * (40 / 80) * 2.0**2, rel=1e-9)
    assert (run.units["theta_m"], run.units["T_1"]) == ("m", "N")


def test_a_motor_behind_a_split_shaft() -> None:
    """Both meshes rigid would close a rigid loop; compliant, the ring carries both pinions."""
    m = train("double_pinion", mesh="compliant", then="[split_shaft]\nratio = 1\nstiffness = 1e4\n")
    assert m.core.bodies == ["motor_1", "pinion_1", "pinion_2", "table"]
    run = simulate(m, end=5.0, load=-50.0)
    inertia = J_M + I_M**2 * (I_G**2 * J_D + 2 * J_C)
    tail = slice(run.t.size // 2, None)
    slope = np.polyfit(run.t[tail], run["omega_m"][tail], 1)[0]
    assert slope == pytest.approx(50 / inertia, rel=5e-3)


def test_a_formula_a_recorded_input_and_a_late_slave() -> None:
    """Drag by a user's formula decays as exp(-c t / J); the load is a recorded ramp."""
    drag = (
        '[[effects]]\neffect = "expression"\nplace = "table"\nformula = "-c*omega_m"\n'
        'parameters = { c = "30 N*m*s/rad" }\n'
    )
    m = train(then=drag)
    inertia = J_M + 2 * I_M**2 * (I_G**2 * J_D + J_C)
    run = simulate(m, end=3.0, initial={"omega_m": 0.1})
    assert run["omega_m"][-1] == pytest.approx(0.1 * math.exp(-30 * 3.0 / inertia), rel=1e-8)
    ramp = (np.array([0.0, 3.0]), np.array([0.0, -60.0]))
    m.set("expression@table.c", 0)
    pushed = simulate(m, end=3.0, load=ramp)
    assert pushed["omega_m"][-1] == pytest.approx(0.5 * 60 * 3.0 / inertia, rel=1e-8)


def test_the_slave_gets_its_command_late() -> None:
    m = Machine.load("heavy-table-100t")
    m.set("controller.delta_t", "40 ms")
    m.set("controller.T_ten", 0)
    m.set("controller.g_E", 0)
    run = simulate(m, parse_motion("move:0.02,v=0.03,a=0.01,j=0.05,start=0.5,end=3"))
    master, slave = run["Omega_1*"], run["Omega_2*"]
    assert np.abs(master).max() > 0.1
    assert slave[40:] == pytest.approx(master[:-40], abs=1e-7)


def test_a_ticked_loop_holds_its_output() -> None:
    m = Machine.load("heavy-table-100t")
    for loop in ("position", "speed", "tension"):
        m.set(f"controller.{loop}_sample", "4 ms")
    run = simulate(m, parse_motion("move:0.02,v=0.03,a=0.01,j=0.05,start=0.1,end=1"))
    changes = np.flatnonzero(np.diff(run["T_1*"]))
    assert run.ok
    assert len(changes) > 100
    assert set((changes + 1) % 4) <= {0, 1}  # a sample at the tick may show either side


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ('drive_train = "single_motor"\ndrives = 2', "a single_motor has one drive"),
        (
            'drive_train = "double_pinion"\n[split_shaft]\nratio = 1\n',
            "split_shaft.stiffness is mi",
        ),
    ],
)
def test_what_a_train_cannot_be(more: str, told: str) -> None:
    text = PARTS.format(train="X", more="", motor="direct", gearbox="rigid", mesh="gap")
    with pytest.raises(MachineError, match=told):
        Machine.from_toml(text.replace('drive_train = "X"', more))


def test_both_pinions_of_a_rigid_ring_on_one_shaft_are_overdetermined() -> None:
    then = '[split_shaft]\nratio = 1\nstiffness = 1e4\nkind = "rigid"\n'
    with pytest.raises(MachineError, match=r"closes a loop|joined rigidly already"):
        train("double_pinion", mesh="rigid", then=then)
