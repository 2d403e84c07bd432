"""What root-finding between steps gets wrong unless it is told: starts on a surface, grazing,
crossings in one step, coinciding instants, bounces without end, laws that contradict themselves.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import pi, sqrt

import numpy as np
import pytest

from core_machines import (
    DEFAULT_RTOL,
    apart,
    core_inputs,
    core_machine,
    nearest_times,
    run,
    run_like,
)
from dualdrive import _core
from reference_model import Motion, heavy_table, load_ramp, simulate, step

pytestmark = pytest.mark.usefixtures("both_engines")

METHODS = ("adams", "bdf")


def lone_pinion(K: float = 1e6, gap: float = 1e-3, J: float = 1.0, c: float = 0.0) -> _core.Machine:
    """Return one pinion that moves freely in the gap of a locked table."""
    machine = _core.Machine()
    machine.add_body("pinion_1")
    machine.add_body("table", locked=True)
    machine.connect("mesh_1", "pinion_1", "table", "gap", "driver")
    for name, value in {"pinion_1.J": J, "mesh_1.stiffness": K, "mesh_1.gap": gap}.items():
        machine.set(name, value)
    if c:
        machine.set(f"{machine.add_effect('mesh_damping', 'mesh_1')}.coefficient", c)
    return machine


def pushed(machine: _core.Machine, torque: str, **numbers: float) -> _core.Machine:
    machine.add_expression("pinion_1", torque, [(k, "N*m", v) for k, v in numbers.items()])
    return machine


def test_default_tolerance_is_the_one_these_tests_speak_of() -> None:
    start = {"omega_c1": 0.1}
    stated, default = (
        _core.simulate(lone_pinion(), {}, end=1.0, initial=start, **options)  # type: ignore[arg-type]
        for options in ({"rtol": DEFAULT_RTOL}, {})
    )
    np.testing.assert_array_equal(stated.values, default.values)


# ----------------------------------------------------------------------- crossings in one step


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("rtol", "late"), [(1e-8, 5e-4), (1e-10, 5e-5)])
def test_contacts_of_45_microseconds_in_a_flight_of_20_milliseconds(
    method: str, rtol: float, late: float
) -> None:
    """A free flight is integrated exactly by any step, so every step leaps a contact."""
    contact, speed, gap = 45e-6, 0.1, 1e-3
    machine = lone_pinion(K=(pi / contact) ** 2, gap=gap)
    bounce = run(machine, end=2.0, initial={"omega_c1": speed}, rtol=rtol, method=method)
    period = 2 * gap / speed + contact
    made = gap / speed + period * np.arange(100)
    expected = np.sort(np.concatenate([made, made + contact]))
    times = [t for t, *_ in bounce.contacts]
    assert len(times) == 200
    np.testing.assert_allclose(times, expected, rtol=0, atol=late)  # speed is lost by rounding
    np.testing.assert_allclose(np.diff(times)[::2], contact, rtol=1e-4)


def on_a_spring(gap: float) -> _core.Machine:
    machine = lone_pinion(K=1e6, gap=gap)
    machine.add_body("frame", locked=True)
    machine.connect("spring_1", "pinion_1", "frame", "compliant", "driver")
    machine.set("spring_1.stiffness", (2 * pi) ** 2)
    return machine


@pytest.mark.parametrize(("beyond", "contacts"), [(1e-6, 0), (-1e-6, 40), (-1e-8, 40)])
def test_grazing_contacts_are_made_or_not(beyond: float, contacts: int) -> None:
    """A pinion on a spring swings 1 mrad at 1 Hz in a gap a millionth wider or narrower."""
    start = {
        "mesh_1.twist": 0.5e-3,
        "spring_1.twist": 0.5e-3,
        "omega_c1": 2 * pi * sqrt(0.75) * 1e-3,
    }
    swing = run(on_a_spring(1e-3 * (1 + beyond)), end=10.0, initial=start, rtol=1e-12)
    assert len(swing.contacts) == contacts
    np.testing.assert_allclose(swing["omega_c1"][-1], start["omega_c1"], rtol=1e-3)
    if contacts:
        depth = -beyond * 1e-3  # a short cap of the swing: x = 1e-3 (1 − (2π t)²/2)
        made = [t for t, _, before, _ in swing.contacts if before == 0]
        left = [t for t, _, before, _ in swing.contacts if before != 0]
        assert max(np.subtract(left, made)) < 2 * sqrt(2 * depth / 1e-3) / (2 * pi) * 1.1
        np.testing.assert_allclose(np.diff(made), 0.5, atol=5e-4)


# -------------------------------------------------------------------------- starts on a surface


@pytest.mark.parametrize("speed", [0.0, 0.01, -0.01])
@pytest.mark.parametrize("rate", [0.0, 1e5, -1e5])
@pytest.mark.parametrize("flank", [1, -1])
def test_start_with_a_flank_just_touching(speed: float, rate: float, flank: int) -> None:
    """Value, speed, acceleration and jerk of the guard may all be zero at the start."""
    table = heavy_table(dry_friction=False).both(c=0.0)
    table = replace(table, controller=None)
    start = {"x_1": flank * 1.1e-3, "x_2": -flank * 1.1e-3, "omega_c1": speed}
    motion = load_ramp(rate)
    exact = simulate(table, motion, 0.5, start=start)
    seen = run_like(table, motion, 0.5, initial=start, rtol=1e-12)
    assert apart(seen, exact) < 1e-9
    first = 1e-4  # before it, a guard that leaves zero slowly is still within rounding
    later = [[c for c in contacts if c[0] > first] for contacts in (seen.contacts, exact.contacts)]
    assert [c[1:] for c in later[0]] == [c[1:] for c in later[1]]
    np.testing.assert_allclose([c[0] for c in later[0]], [c[0] for c in later[1]], atol=1e-9)


@pytest.mark.parametrize("torque", [50.0, -50.0])
def test_start_on_the_surface_under_a_constant_push(torque: float) -> None:
    """Into the flank: x − Δ = T/K (1 − cos ωt); away from it: free flight to the other flank."""
    machine = pushed(lone_pinion(), "a", a=torque)
    seen = run(machine, end=0.005, initial={"mesh_1.twist": 1e-3}, output_step=1e-4)
    if torque > 0:
        expected = 1e-3 + torque / 1e6 * (1 - np.cos(1e3 * seen.t))
        np.testing.assert_allclose(seen["mesh_1.twist"], expected, atol=1e-10)
        assert [c[2:] for c in seen.contacts] == [(0, 1)]
    else:
        np.testing.assert_allclose(seen["mesh_1.twist"], 1e-3 + torque * seen.t**2 / 2, atol=1e-12)
        assert not seen.contacts


def test_a_body_at_rest_is_not_sliding_the_wrong_way() -> None:
    """A torque that steps from −60 to +60 N m at the start breaks the body loose forwards."""
    machine = _core.Machine()
    machine.add_body("table")
    machine.add_motor("motor_1", "table", "direct")
    machine.set(f"{machine.add_effect('coulomb', 'table')}.torque", 20.0)
    torque = _core.Waveform([0.0], [[-60.0], [60.0]])
    slid = run(machine, {"T_1": torque}, 1.0)
    np.testing.assert_allclose(slid["omega_m"], 40.0 * slid.t, atol=1e-7)


# ------------------------------------------------------------------------- coinciding instants


def test_simultaneous_contacts_of_equal_drives() -> None:
    """Two equal pinions touch at one time and go on alike."""
    table = replace(heavy_table(dry_friction=False).both(c=0.0), controller=None)
    start = {"omega_c1": 0.1, "omega_c2": 0.1}
    seen = run_like(table, Motion(), 2.0, initial=start)
    first, second = ([c for c in seen.contacts if c[1] == n] for n in (1, 2))
    assert len(first) == len(second) > 5
    np.testing.assert_allclose([c[0] for c in first], [c[0] for c in second], rtol=0, atol=1e-10)
    np.testing.assert_allclose(seen["omega_c1"], seen["omega_c2"], atol=1e-10)
    assert nearest_times(seen, simulate(table, Motion(), 2.0, start=start)) < 1e-7


@pytest.mark.parametrize("speed", [0.01, 0.1])
def test_contact_at_an_output_time_a_break_and_a_tick(speed: float) -> None:
    """The flank is met at 0.1 s or 0.01 s: an output, a step of the load and a tick as well."""
    table = heavy_table(dry_friction=False).both(c=0.0, gap=1e-3, b_d=0, b_c=0)
    table = table.both(R=1e3, K_d=1e-9, C_e=0.0)  # a motor too weak to disturb
    touch = 1e-3 / speed
    machine = core_machine(table)
    for loop in ("position", "speed"):
        machine.set(f"controller.{loop}_sample", 1e-3)
    inputs = core_inputs(Motion()) | {"T_load": _core.step(1.0, touch)}
    seen = run(machine, inputs, 3 * touch, initial={"omega_c1": speed}, times=[touch, 2 * touch])
    assert next(c[1:] for c in seen.contacts if c[1] == 1) == (1, 0, 1)
    assert next(c[0] for c in seen.contacts if c[1] == 1) == pytest.approx(touch, abs=1e-9)
    assert seen["mesh_1.twist"][0] == pytest.approx(1e-3, rel=1e-9)
    assert seen["T_load"].tolist() == [1.0, 1.0]


def test_a_step_of_the_command_changes_many_modes_at_one_instant() -> None:
    table = heavy_table(100).both(T_max=20.0, U_max=40.0).control(K_d=1.0, Omega_E=0.01)
    motion = step(0.02, at=0.1)
    exact, seen = simulate(table, motion, 1.0), run_like(table, motion, 1.0)
    at_once = [event for event in seen.raw.events if event[0] == 0.1]
    assert len(at_once) >= 3
    assert apart(seen, exact) < 1e-7
    assert nearest_times(seen, exact) < 1e-8


# ------------------------------------------------------------------------ bounces without end


def test_bounces_that_die_out() -> None:
    """A damped flank under a steady push: ever shorter flights, then rest at T/K."""
    machine = pushed(lone_pinion(c=200.0), "a", a=5.0)
    seen = run(machine, end=2.0, initial={"omega_c1": 0.05})
    flights = [
        made[0] - left[0]
        for left, made in pairwise(seen.contacts)
        if left[2:] == (1, 0) and made[2:] == (0, 1)
    ]
    assert len(flights) > 5
    ratios = np.divide(flights[1:], flights[:-1])
    assert np.all((ratios > 0) & (ratios < 1))
    assert seen["mesh_1.twist"][-1] == pytest.approx(1e-3 + 5.0 / 1e6, rel=1e-9)


def test_a_stiff_and_undamped_rattle_goes_on() -> None:
    seen = run(lone_pinion(K=1e10, gap=1e-6), end=0.1, initial={"omega_c1": 0.1})
    flight, contact = 2e-6 / 0.1, pi / 1e5
    made = [c[0] for c in seen.contacts if c[2] == 0]
    assert len(made) == int(np.floor((0.1 - 1e-5) / (flight + contact))) + 1
    np.testing.assert_allclose(np.diff(made), flight + contact, rtol=1e-5)


# ------------------------------------------------------------------------ contradictions end


@pytest.mark.parametrize("start", [0.0, 0.1])
@pytest.mark.parametrize("method", METHODS)
def test_a_formula_that_decides_its_own_sign_ends_as_chattering(start: float, method: str) -> None:
    """−a sign(speed) is not friction: at rest neither sign is right. Coulomb friction is."""
    machine = pushed(lone_pinion(), "-a * sign(speed)", a=5.0)
    result = _core.simulate(machine, {}, end=1.0, initial={"omega_c1": start}, method=method)
    assert result.status == "chattering"
    assert result.statistics["rhs"] < 10_000
    assert "expression@pinion_1" in result.message
    assert "add damping" in result.message
    assert result.t[-1] <= start / 5.0
    assert np.isfinite(result.values).all()


def test_a_formula_that_drives_away_from_its_kink_does_not_chatter() -> None:
    machine = pushed(lone_pinion(gap=10.0), "a * sign(speed)", a=5.0)
    seen = run(machine, end=1.0, initial={"omega_c1": 0.1})
    np.testing.assert_allclose(seen["omega_c1"], 0.1 + 5.0 * seen.t, rtol=1e-9)


# ----------------------------------------------------------------------- no gap, rigid, sparse


@pytest.mark.parametrize("gap", [1e-15, 1e-12, 1e-9])
def test_a_tiny_gap_is_nearly_none(gap: float) -> None:
    without = run(lone_pinion(gap=0.0), end=0.1, initial={"omega_c1": 0.1})
    narrow = run(lone_pinion(gap=gap), end=0.1, initial={"omega_c1": 0.1})
    assert not without.contacts
    assert without.raw.elements == []
    expected = 1e-4 * np.sin(1e3 * without.t)  # a spring that pushes and pulls
    np.testing.assert_allclose(without["mesh_1.twist"], expected, atol=1e-11)
    np.testing.assert_allclose(narrow["mesh_1.twist"], expected, atol=1e-10 + 300 * gap)
    assert len(narrow.contacts) == pytest.approx(64, abs=2)


def test_a_rigid_mesh_is_the_limit_of_a_stiff_one() -> None:
    table = replace(heavy_table(dry_friction=False).both(c=0.0, gap=0.0), controller=None)
    voltage = {f"U_{n}": _core.sine(20.0, 1.0) for n in (1, 2)}
    stiff = core_machine(table.both(K_t=1e12))
    rigid = _core.Machine()
    for n in (1, 2):
        rigid.add_body(f"motor_{n}")
        rigid.add_body(f"pinion_{n}")
    rigid.add_body("table")
    for n in (1, 2):
        rigid.connect(f"gearbox_{n}", f"motor_{n}", f"pinion_{n}", "rigid", "driven")
        rigid.connect(f"mesh_{n}", f"pinion_{n}", "table", "rigid", "driver")
        rigid.add_motor(f"motor_{n}")
    unused = ("stiffness", "gap", "preload")
    for path in (parameter.path for parameter in rigid.parameters()):
        if not path.endswith(unused):
            rigid.set(path, stiff.get(path))
    a, b = (run(machine, voltage, 1.0) for machine in (stiff, rigid))
    assert "mesh_1.twist" not in dict(rigid.states())
    for name in ("omega_m", "theta_m", "I_1", "omega_1"):
        peak = np.abs(b[name]).max()
        assert np.abs(a[name] - b[name]).max() < 1e-4 * peak


def test_a_machine_at_rest_takes_steps_of_any_length() -> None:
    rest = run(lone_pinion(), end=1e6, output_step=1e5)
    assert rest.raw.statistics["steps"] < 100
    assert not rest["omega_c1"].any()


def test_sparse_outputs_see_what_dense_ones_see() -> None:
    dense = run(lone_pinion(), end=10.0, initial={"omega_c1": 0.1})
    sparse = run(lone_pinion(), end=10.0, initial={"omega_c1": 0.1}, times=[0.0, 3.217, 10.0])
    assert [e[1:] for e in sparse.raw.events] == [e[1:] for e in dense.raw.events]
    np.testing.assert_allclose([e[0] for e in sparse.raw.events],
                               [e[0] for e in dense.raw.events], rtol=1e-12)  # fmt: skip
    assert sparse["omega_c1"][1] == pytest.approx(dense["omega_c1"][3217], abs=1e-9)
    assert sparse["omega_c1"][2] == pytest.approx(dense["omega_c1"][-1], abs=1e-12)
