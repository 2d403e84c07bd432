"""Position loops closed at the motor or on both encoders; set-point filters; tooth forces."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dualdrive import Machine, _core, linear
from dualdrive.motion import parse_motion
from dualdrive.simulation import simulate

ARCSEC = math.pi / 648000
MOVE = parse_motion("move:0.01,v=0.03,a=0.01,j=0.05,start=1,end=6")


def table(**changes: float | str) -> Machine:
    machine = Machine.load("heavy-table-250t")
    for path, value in changes.items():
        machine.set(path.replace("__", "."), value)
    return machine


# --- position sensor ------------------------------------------------------------------------------


@pytest.mark.parametrize("sensor", ["table", "motor", "both"])
@pytest.mark.parametrize("sample", [0.0, 2e-3])
def test_engines_agree_whichever_encoder_closes_the_loop(sensor: str, sample: float) -> None:
    machine = table(controller__position_sensor=sensor, controller__position_sample=sample)
    exact, other = (
        simulate(machine, MOVE, engine=engine, rtol=1e-9, energy=False)
        for engine in ("exact", "cvode")
    )
    np.testing.assert_allclose(exact["theta_m"], other["theta_m"], atol=1e-9)


def test_at_rest_each_sensor_holds_its_own_angle() -> None:
    """The motor's encoder leaves half the play and the wind-up to the table; both leave nothing."""
    left = {}
    for sensor in ("table", "motor", "both"):
        run = simulate(table(controller__position_sensor=sensor), MOVE, energy=False)
        left[sensor] = run["theta_ref"][-1] - run["theta_m"][-1]
        assert run["sensed.table"][-1] == pytest.approx(run["theta_ref"][-1], abs=1e-7)
        if sensor == "motor":
            twist = run["mesh_1.twist"][-1] / 20.0
            assert left["motor"] == pytest.approx(twist, abs=1e-9)
            assert twist > 1.1e-3 / 20.0
    assert abs(left["table"]) < 1e-9
    assert abs(left["both"]) < 1e-7


def test_a_long_time_of_going_over_is_the_motor_a_short_one_the_table() -> None:
    slow = table(controller__position_sensor="both", controller__tau_s=1e6)
    fast = table(controller__position_sensor="both", controller__tau_s=1e-4)
    motor, encoder = (table(controller__position_sensor=s) for s in ("motor", "table"))
    for one, other, off in ((slow, motor, 1e-9), (fast, encoder, 2e-6)):
        left, right = (simulate(m, MOVE, energy=False)["theta_m"] for m in (one, other))
        np.testing.assert_allclose(left, right, atol=off)


def test_the_linear_model_is_closed_at_the_same_place() -> None:
    """Slow motion of a motor-side loop does not see what a load does behind the motor."""
    stiff = {}
    for sensor in ("table", "motor"):
        machine = table(controller__position_sensor=sensor, controller__K_i=5.0)
        answer = linear.frequency_response(machine, "T_load", "theta_m", [1e-3])
        stiff[sensor] = abs(answer.response[0])
    meshes = 1.0 / (2 * 2e7 * 20.0**2)  # two closed flanks in parallel, rad per N m
    assert stiff["motor"] == pytest.approx(meshes, rel=0.6)
    assert stiff["table"] < 0.01 * stiff["motor"]


def test_a_changed_position_sensor_survives_files_and_pickles() -> None:
    import pickle

    machine = table(controller__position_sensor="both", motors__filter_pole=90.0)
    again = Machine.from_toml(machine.toml())
    assert again.core.controller_options["position_sensor"] == "both"
    assert again.get("motor_2.filter_pole") == 90.0
    assert pickle.loads(pickle.dumps(machine.core)).controller_options["position_sensor"] == "both"


@pytest.mark.parametrize(
    ("effect", "place", "numbers", "words"),
    [
        ("encoder_eccentricity", "table", {"amplitude": 1e-5}, "nothing in the loop reads"),
        ("radial_shift", "table", {"compliance": 1e-9}, "nothing in the loop reads"),
        ("sensor_delay", "motor_1", {"time": 1e-3}, "no delay of its own"),
    ],
)
def test_sensors_that_nothing_reads_are_refused(
    effect: str, place: str, numbers: dict[str, float], words: str
) -> None:
    machine = table(controller__position_sensor="motor")
    with pytest.raises(ValueError, match=words):
        machine.add(effect, place, **numbers)


# --- set-point filters ----------------------------------------------------------------------------

FILTERS = {
    "low-pass": {"motors.filter_pole": 40.0, "motors.filter_pole_damping": 0.7},
    "notch": {"motors.filter_pole": 40.0, "motors.filter_zero": 40.0,
              "motors.filter_zero_damping": 0.07},
}  # fmt: skip


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_has_the_response_of_its_formula(name: str) -> None:
    """From the torque set-point to the filtered one, drive by drive."""
    from dualdrive.tune.filters import Filter

    machine = table()
    for path, value in FILTERS[name].items():
        machine.set(path, value)
    core = machine.core
    f = np.array([5.0, 30.0, 40.0, 55.0, 200.0])
    shown = Filter(*(core.get(f"motors.filter_{n}") for n in ("pole", "pole_damping", "zero",
                                                              "zero_damping")))  # fmt: skip
    answers = [
        linear.frequency_response(machine, "Omega_1*", signal, f).response
        for signal in ("filtered.motor_1", "T_1*")
    ]
    np.testing.assert_allclose(answers[0] / answers[1], shown.response(f), rtol=1e-9)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("kind", ["armature", "direct"])
def test_engines_agree_on_filtered_drives(name: str, kind: str) -> None:
    machine = table(controller__g_E=0.0 if kind == "direct" else 0.5, motors__kind=kind)
    for path, value in FILTERS[name].items():
        machine.set(path, value)
    exact, other = (
        simulate(machine, MOVE, engine=e, rtol=1e-9, energy=False) for e in ("exact", "cvode")
    )
    np.testing.assert_allclose(exact["theta_m"], other["theta_m"], atol=1e-9)
    size = float(np.abs(exact["T_1*"]).max())
    behind = "filtered.motor_1"
    np.testing.assert_allclose(exact[behind], other[behind], atol=1e-4 * size)


def test_slopes_by_a_filter_s_numbers() -> None:
    machine = table(motors__filter_pole=20.0, motors__filter_zero=30.0)
    path = "motor_1.filter_pole"
    run = simulate(machine, MOVE, end=2.5, sensitivities=[path], rtol=1e-9, energy=False)
    ends = []
    for step in (-0.01, 0.01):
        other = machine.copy()
        other.set(path, 20.0 + step)
        ends.append(simulate(other, MOVE, end=2.5, rtol=1e-10, energy=False)["theta_m"][-1])
    slope = (ends[1] - ends[0]) / 0.02
    assert run.sensitivity("theta_m", path)[-1] == pytest.approx(slope, rel=1e-3)


def test_numbers_of_a_filter_that_is_not_there_are_not_read() -> None:
    core = table().core
    assert "no set-point filter" in core.unread("motor_1.filter_zero")
    core.set("motors.filter_pole", 50.0)
    assert core.unread("motor_1.filter_zero") == ""
    assert "is a low-pass" in core.unread("motor_1.filter_zero_damping")


# --- tooth forces ---------------------------------------------------------------------------------


def test_tension_shifts_a_table_whose_meshes_stand_opposite() -> None:
    """Both meshes push the same way: T_1 - T_2 i i_m / r on the bearing, by the head's angle."""
    machine = table()
    machine.add("radial_shift", "table", compliance=1e-9, scale_radius=0.25, ring_radius=4.0)
    run = simulate(machine, MOVE, energy=False)
    force = 20.0 * (run["mesh_1.torque"][-1] - run["mesh_2.torque"][-1]) / 4.0
    assert run["sensed.table"][-1] - run["theta_m"][-1] == pytest.approx(1e-9 * force / 0.25)
    assert run["theta_m"][-1] == pytest.approx(run["theta_ref"][-1] - 4e-9 * force, abs=1e-9)
    tilted = table()
    tilted.add("table_tilt", "table", compliance=1e-11, ring_height=0.5, scale_height=0.5)
    exact, other = (simulate(tilted, MOVE, engine=e, rtol=1e-9) for e in ("exact", "cvode"))
    np.testing.assert_allclose(exact["theta_m"], other["theta_m"], atol=1e-9)


def test_a_mesh_without_flanks_leaves_the_size_of_its_force_to_stepping_engines() -> None:
    machine = table(meshes__kind="compliant")
    machine.add("radial_shift", "table", compliance=1e-9)
    with pytest.raises(ValueError, match="radial_shift@table is not affine"):
        simulate(machine, MOVE, engine="exact")
    assert simulate(machine, MOVE, end=1.5, energy=False).ok


def test_forces_of_teeth_are_refused_where_they_are_not_known() -> None:
    with pytest.raises(ValueError, match="sits at table"):
        table().add("radial_shift", "theta_m", compliance=1e-9)
    rigid = Machine.load("linear-axis")
    with pytest.raises(ValueError, match="is rigid"):
        rigid.add("radial_shift", "table", compliance=1e-9)
    machine = table()
    machine.add("radial_shift", "table", compliance=1e-9)
    with pytest.raises(ValueError, match=r"signal sensed\.table"):
        _core.record(machine.core, "table", np.zeros(2), np.zeros(2))
