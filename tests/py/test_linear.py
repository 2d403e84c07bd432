"""Modes of Eq. 23 and small-signal responses, against matrices and transfer functions by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from core_machines import core_machine, drive_train, set_all
from dualdrive import Machine, linear
from dualdrive.linear.small_signal import loops_of
from reference_model import Machine as Reference
from reference_model import heavy_table
from test_reference_model import drives_apart

SIDES = (-1, 0, 1)
NINE = [(a, b) for a in SIDES for b in SIDES]


def apart() -> Reference:
    """A table whose drives differ in everything, without dry friction, damped meshes, control."""
    machine = heavy_table(250, dry_friction=False).both(c=0.0)
    first, second = machine.drives
    second = replace(second, gap=2e-3, K_t=1.7e7, J_d=0.05, b_c=150.0, C_e=1.2, K_d=1.1, R=0.2)
    return replace(machine, controller=None, drives=(first, second))


# ------------------------------------------------------------------------------ Eq. 23, corrected


def by_hand(m: Reference, s: tuple[int, int]) -> tuple[Any, Any, Any, Any]:
    """A', B', C, v entry by entry, columns omega_c1 omega_c2 theta_c1 theta_c2 I_1 I_2 theta_m."""
    (one, two), i, J = m.drives, m.i_m, m.J_m
    c1, c2 = abs(s[0]) * one.K_t, abs(s[1]) * two.K_t  # stiffness of a flank that is closed
    A = [
        [-one.b / one.J, 0, -c1 / one.J, 0, one.K_m / one.J, 0, i * c1 / one.J, 0],
        [0, -two.b / two.J, 0, -c2 / two.J, 0, two.K_m / two.J, i * c2 / two.J, 0],
        [1, 0, 0, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0, 0, 0],
        [-one.K_e / one.L, 0, 0, 0, -one.R / one.L, 0, 0, 0],
        [0, -two.K_e / two.L, 0, 0, 0, -two.R / two.L, 0, 0],
        [0, 0, 0, 0, 0, 0, 0, 1],
        [0, 0, i * c1 / J, i * c2 / J, 0, 0, -(i**2) * (c1 + c2) / J, -m.b_m / J],
    ]
    B = np.zeros((8, 2))
    B[4, 0], B[5, 1] = 1 / one.L, 1 / two.L
    C = np.zeros((8, 2))
    C[0, 0], C[1, 1], C[7] = c1 / one.J, c2 / two.J, (-i * c1 / J, -i * c2 / J)
    return np.array(A), B, C, np.array([s[0] * one.gap, s[1] * two.gap])


@pytest.mark.parametrize("machine", [apart(), drives_apart()])
@pytest.mark.parametrize("sides", NINE)
def test_modes_are_eq_23_corrected(machine: Reference, sides: tuple[int, int]) -> None:
    A, B, C, v = by_hand(machine, sides)
    mode = linear.modes(core_machine(machine))[str(sides)]
    np.testing.assert_allclose(mode.A, A, rtol=1e-12, atol=1e-13 * np.abs(A).max())
    np.testing.assert_allclose(mode.B, B, rtol=1e-14)
    np.testing.assert_allclose(mode.C, C, rtol=1e-12, atol=1e-15 * np.abs(C).max())
    np.testing.assert_allclose(mode.v, v)
    np.testing.assert_allclose(mode.offset, 0)
    np.testing.assert_allclose(mode.load, [0] * 7 + [-1 / machine.J_m])
    i = machine.i_m
    np.testing.assert_allclose(
        mode.guards, [[0, 0, 1, 0, 0, 0, -i, 0], [0, 0, 0, 1, 0, 0, -i, 0]], atol=1e-15
    )
    assert (mode.states, mode.sides) == (linear.STATES, sides)


def test_there_are_nine_modes() -> None:
    assert list(linear.modes(core_machine(apart()))) == [str(sides) for sides in NINE]


def test_mesh_damping_is_in_the_matrix_and_dry_friction_beside_it() -> None:
    """T = K dz + c dx/dt; sliding forward, Coulomb's torque is constant."""
    machine = heavy_table(100)
    mode = linear.modes(core_machine(machine))["(1, 0)"]
    drive = machine.drives[0]
    assert mode.A[0, 0] == pytest.approx(-(drive.b + drive.c) / drive.J)
    assert mode.A[0, 7] == pytest.approx(machine.i_m * drive.c / drive.J)
    assert mode.A[1, 7] == 0
    np.testing.assert_allclose(mode.offset[[0, 1, 7]], [
        -300 / drive.J, -300 / drive.J, -2000 / machine.J_m,
    ])  # fmt: skip


def test_the_printed_matrix_grows_the_corrected_one_keeps_its_energy() -> None:
    """Physics §1: with U = R = b = 0 and both flanks closed, +28.5 1/s as printed."""
    machine = drives_apart()
    (one, two), i, J = machine.drives, machine.i_m, machine.J_m
    right = linear.modes(core_machine(machine))["(1, 1)"]
    assert np.abs(right.eigenvalues.real).max() < 1e-4  # 1e-8, but for three angles at zero
    printed = right.A.copy()
    printed[0, 4], printed[1, 5] = one.K_t / one.J, two.K_t / two.J
    printed[4, 0] = -two.K_e / one.L
    printed[7, 6] = (one.K_t + two.K_t) * i**2 / J
    assert np.linalg.eigvals(printed).real.max() == pytest.approx(28.5, abs=0.05)


def test_other_plants_are_no_instance_of_eq_23() -> None:
    for name in ("linear-axis", "heavy-table-single-motor", "heavy-table-dual-servo"):
        with pytest.raises(linear.LinearError, match=r"Eq\. 23 is two motors.*has the states"):
            linear.modes(Machine.load(name))


# -------------------------------------------------------------------- responses in closed form


def table(load: str = "250t", **controller: float) -> Machine:
    machine = Machine.load(f"heavy-table-{load}")
    for name, value in controller.items():
        machine.set(f"controller.{name}", value)
    return machine


def by_formula(reference: Reference, f: Any) -> tuple[Any, Any]:
    """Table speed and pinion speed per common speed set-point, both flanks closed, equal drives.

    (J s + b + C_v) w + T = C_v W, T = (K/s + c)(w - i_m w_m), (J_m s + b_m) w_m = 2 i_m T with
    C_v = k_p (1 + 1/(T_N s)) / (1 + s/w_ci): physics §6.6.
    """
    drive, law, s = reference.drives[0], reference.controller, 2j * np.pi * f
    assert law is not None
    assert law.omega_ci is not None
    C_v = law.k_p * (1 + 1 / (law.T_N * s)) / (1 + s / law.omega_ci)
    K = drive.K_t / s + drive.c
    x = np.linalg.solve(
        np.stack([
            np.stack([drive.J * s + drive.b + C_v + K, -reference.i_m * K], -1),
            np.stack([-2 * reference.i_m * K,
                      reference.J_m * s + reference.b_m + 2 * reference.i_m**2 * K], -1),
        ], -2),
        np.stack([C_v, 0 * s], -1)[..., None],
    )[..., 0]  # fmt: skip
    return x[:, 1], x[:, 0]


F = np.geomspace(0.05, 60, 40)


@pytest.mark.parametrize("modes", ["(1, 1)", (1, -1)])
def test_the_position_loop_is_that_of_the_formula(modes: Any) -> None:
    law = heavy_table(250).controller
    assert law is not None
    speed, _ = by_formula(heavy_table(250), F)
    s = 2j * np.pi * F
    loop = linear.open_loop(table(), "position", F, modes=modes)
    np.testing.assert_allclose(loop.response, 20 * law.K_v * speed / s, rtol=1e-9)
    closed = linear.frequency_response(table(), "theta_ref", "theta_m", F, modes=modes)
    forward = 20 * (law.K_v + s) * speed / s  # f_v = 1
    np.testing.assert_allclose(closed.response, forward / (1 + loop.response), rtol=1e-9)


def test_the_critical_position_gain_is_known() -> None:
    """Physics §5: 16.4 1/s at 550 t, with the current loop as it is."""
    loop = linear.open_loop(table("550t"), "position", modes="(1, 1)").margins()
    assert loop.stable
    assert loop.gain_db is not None
    assert 5 * 10 ** (loop.gain_db / 20) == pytest.approx(16.4, abs=0.05)
    beyond = linear.open_loop(table("550t", K_v=16.5), "position", modes="(1, 1)").margins()
    assert (beyond.stable, beyond.gain_db, beyond.phase_deg) == (False, None, None)
    assert "unstable" in beyond.text


@pytest.mark.parametrize(("name", "locked"), [("empty", 11.6), ("100t", 9.0), ("550t", 4.9)])
def test_the_speed_loop_dips_at_the_locked_rotor_frequency(name: str, locked: float) -> None:
    """Physics §5; a zero of the pinion's answer, damped by the meshes."""
    f = np.linspace(0.8 * locked, 1.2 * locked, 401)
    answer = linear.frequency_response(
        table(name), "Omega_1", "omega_c1", f, modes="(1, 1)", cut=["position", "equaliser"]
    )
    _, right = by_formula(heavy_table({"empty": 0, "100t": 100, "550t": 550}[name]), f)
    np.testing.assert_allclose(answer.response, right, rtol=1e-9)
    assert f[np.abs(answer.response).argmin()] == pytest.approx(locked, abs=0.1)


@pytest.mark.parametrize("block", ["position", "equaliser", "speed_1", "speed_2", "current_1"])
def test_what_is_added_at_a_cut_is_divided_by_the_return_difference(block: str) -> None:
    """x = w - L x wherever the loop is entered, unequal drives included."""
    machine = table(K_i=0.5, delta_c=2e-3, delta_t=5e-3)
    machine.set("motor_2.J", 0.06)
    loop = linear.open_loop(machine, block, F, outer="closed")
    output = loops_of(machine.core)[block]
    inside = linear.frequency_response(machine, output, output, F)
    np.testing.assert_allclose(inside.response, 1 / (1 + loop.response), rtol=1e-7)


def test_inner_loops_are_measured_with_the_outer_ones_open() -> None:
    loop = linear.open_loop(table(), "speed_1", F)
    outer = ["position", "equaliser"]
    inside = linear.frequency_response(table(), "T_1*", "T_1*", F, cut=outer)
    np.testing.assert_allclose(inside.response, 1 / (1 + loop.response), rtol=1e-7)
    current = linear.open_loop(table(), "current_1", F)
    inside = linear.frequency_response(table(), "U_1", "U_1", F, cut=[*outer, "speed_1", "speed_2"])
    np.testing.assert_allclose(inside.response, 1 / (1 + current.response), rtol=1e-7)


# ------------------------------------------------------------------------- delays and sampling


def test_delays_enter_exactly() -> None:
    """The slave's lag parts the two set-points; a late command or sensor turns the loop's phase."""
    late = np.exp(-2j * np.pi * F * 0.01)
    apart = [
        linear.frequency_response(table(delta_t=0.01), "theta_ref", name, F, cut=["equaliser"])
        for name in ("Omega_1*", "Omega_2*")
    ]
    np.testing.assert_allclose(apart[1].response, late * apart[0].response, rtol=1e-9)
    prompt = linear.open_loop(table(), "position", F).response
    delayed = linear.open_loop(table(delta_c=0.01), "position", F)
    np.testing.assert_allclose(delayed.response, late * prompt, rtol=1e-9)
    assert "10 ms late" in delayed.note
    sensing = table()
    sensing.set(f"{sensing.add('sensor_delay', 'table')}.time", 0.01)
    np.testing.assert_allclose(
        linear.open_loop(sensing, "position", F).response, late * prompt, rtol=1e-9
    )


def test_a_late_loop_beyond_its_delay_margin_is_unstable() -> None:
    spare = linear.open_loop(table(), "position").margins().delay_s
    assert spare is not None
    assert linear.open_loop(table(delta_c=0.98 * spare), "position").stable
    assert not linear.open_loop(table(delta_c=1.02 * spare), "position").stable


def test_poles_are_where_the_return_difference_vanishes() -> None:
    """At 550 t and the critical gain a pair stands on the axis, where L = -1."""
    machine = table("550t", K_v=16.376)
    found = linear.poles(machine, modes="(1, 1)")
    edge = found[np.argmin(np.where(np.abs(found) > 1e-6, np.abs(found.real), np.inf))]
    assert abs(edge.real) < 2e-3 * abs(edge)
    loop = linear.open_loop(machine, "position", [abs(edge) / 2 / np.pi], modes="(1, 1)")
    assert loop.response[0] == pytest.approx(-1, abs=0.01)
    assert len(linear.poles(table(delta_c=0.01))) == len(found) + 6


def three_drives(g_E: float) -> Any:
    """Three equal drives at one table, two slaves beside the first, loops sampled."""
    core = drive_train(3)
    core.set_controller(equaliser="slave", current="cascade")
    set_all(core, "motors", {"J": 1e-4, "b": 1e-4, "K_d": 0.3})
    set_all(core, "gearboxes", {"ratio": 10.0})
    set_all(core, "pinions", {"J": 1e-3, "b": 1e-3})
    set_all(core, "meshes", {"ratio": 5.0, "stiffness": 2000.0, "gap": 1e-3})
    set_all(core, "table", {"J": 2.0, "b": 0.2})
    own = {
        "omega_ci": 1000.0,
        "position_sample": 2e-3,
        "tau_t": 0.05,
        "K_v": 5.0,
        "k_p": 0.5,
        "T_N": 0.1,
        "g_E": g_E,
        "T_E": 0.2,
        "T_ten": 0.1,
    }
    set_all(core, "controller", own)
    return core


def test_three_drives_have_their_poles() -> None:
    """What drives apart against each other moves with the equaliser, and all of it dies away."""
    softly, firmly = (linear.poles(three_drives(g)) for g in (0.5, 2.0))
    assert len(softly) == len(firmly)
    free = 1e-6 * np.abs(softly).max()
    for found in (softly, firmly):
        held = found[np.abs(found) > free]
        assert np.all(held.real < 0.0)
    assert np.min(np.abs(softly[:, None] - firmly[None, :]), axis=1).max() > 1e-3


def test_a_vanishing_delay_moves_no_pole() -> None:
    prompt, late = (
        linear.poles(table("550t", delta_c=d), modes="(1, 1)", friction="stuck") for d in (0, 1e-8)
    )
    np.testing.assert_allclose(late[: len(prompt)], prompt, rtol=1e-6, atol=1e-6)


def test_a_sampled_loop_is_its_continuous_law_held() -> None:
    T = 4e-3
    held = linear.open_loop(table(position_sample=T, position_latency=1e-3), "position", F)
    s = 2j * np.pi * F
    hold = np.exp(-1e-3 * s) * (1 - np.exp(-s * T)) / (s * T)
    right = hold * linear.open_loop(table(), "position", F).response
    np.testing.assert_allclose(held.response, right, rtol=1e-9)
    assert "position loop sampled every 4 ms (approximated" in held.note
    with pytest.raises(linear.LinearError, match=r"200 Hz is beyond half the sampling rate.*125 H"):
        linear.open_loop(table(position_sample=T), "position", [10, 200])


def test_state_space_has_the_response_delays_included() -> None:
    control = pytest.importorskip("control")
    machine = table(delta_t=4e-3, delta_c=2e-3, speed_sample=1e-3)
    f = np.geomspace(0.1, 20, 15)
    system = linear.state_space(
        machine, inputs=["theta_ref", "omega_ref"], outputs=["theta_m", "T_1"]
    )
    assert isinstance(system, control.StateSpace)
    s = 2j * np.pi * f
    found = system(s)
    for row, output in enumerate(("theta_m", "T_1")):
        right = linear.frequency_response(machine, "theta_ref", output, f).response
        # the hold has a magnitude, (pi f T)^2 / 6, that a delay has not
        np.testing.assert_allclose(found[row, 0] + s * found[row, 1], right, rtol=2e-3)
    whole = linear.state_space(machine)
    assert {"sensed_table", "mesh_1_torque", "T_1*"} <= set(whole.output_labels)
    mode = linear.modes(machine)["(1, -1)"]
    np.testing.assert_array_equal(linear.state_space(mode).A, mode.A)


def test_without_python_control_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "control", None)
    with pytest.raises(linear.LinearError, match=r"pip install 'dualdrive\[control\]'"):
        linear.state_space(table())


# --------------------------------------------------------------------------------- both drives


@pytest.mark.parametrize("other", ["held", "open"])
def test_equal_drives_answer_alike(other: str) -> None:
    found = linear.compare_drives(table(), other=other)
    assert not found.differ
    assert np.abs(found.difference_db).max() < 1e-9
    assert found.frequency_hz is None


@pytest.mark.parametrize(("path", "factor"), [("motor_2.J", 1.5), ("mesh_2.stiffness", 0.7)])
def test_unequal_drives_part_where_their_parts_differ(path: str, factor: float) -> None:
    machine = table()
    machine.set(path, factor * machine.get(path))
    found = linear.compare_drives(machine)
    assert found.differ
    assert found.frequency_hz is not None
    k = int(np.argmin(np.abs(found.master.frequency_hz - found.frequency_hz)))
    assert max(abs(found.difference_db[k]), abs(found.difference_deg[k]) / 5) > 1
    assert f"most at {found.frequency_hz:.3g} Hz" in found.text
    # far above all resonances inertia alone is left: 1 / (J s)
    high = linear.compare_drives(machine, [400.0], tolerance_db=1e3, tolerance_deg=1e3)
    expected = -20 * np.log10((60 + 150**2 * 0.045 * 1.5) / 1072.5) if path == "motor_2.J" else 0.0
    assert high.difference_db[0] == pytest.approx(expected, abs=0.1)


# -------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: linear.frequency_response(m, "theta", "e"), "no input 'theta'; there are theta"),
        (lambda m: linear.frequency_response(m, "T_load", "x"), "no signal 'x'; there are"),
        (lambda m: linear.frequency_response(m, "T_load", "e", [2, 1]), "positive and increasing"),
        (lambda m: linear.frequency_response(m, "T_load", "e", modes="(1, 2)"), "needs -1 .back"),
        (lambda m: linear.frequency_response(m, "T_load", "e", modes="(1,)"), "needs -1 .back"),
        (lambda m: linear.frequency_response(m, "T_load", "e", modes={"mesh": "gap"}), "no switch"),
        (lambda m: linear.open_loop(m, "speed"), "no block 'speed'; there are position, equaliser"),
        (lambda m: linear.open_loop(m, "position", outer="shut"), "choose open or closed"),
        (lambda m: linear.compare_drives(m, other="off"), "choose held or open"),
    ],
)
def test_what_makes_no_sense_is_refused(call: Any, message: str) -> None:
    with pytest.raises(linear.LinearError, match=message):
        call(table())


def test_a_single_drive_is_not_compared() -> None:
    with pytest.raises(linear.LinearError, match="needs two motors"):
        linear.compare_drives(Machine.load("heavy-table-single-motor"))
