"""Every line of the errata (docs/theory/paper.md): the printed form is wrong, the core's is not.

The entries of Eq. 22 and 23 stand in test_oracle_eq23.py and test_reference_model.py.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from core_machines import core_machine, run
from dualdrive import _core
from reference_model import Machine, heavy_table


def machine() -> Machine:
    """Return a table whose two drives differ, uncontrolled, without dry friction or damping."""
    table = heavy_table(dry_friction=False).both(c=0.0)
    first, second = table.drives
    second = replace(second, C_e=1.3, K_d=1.3, K_t=1.5e7, J_d=0.06, gap=2e-3)
    return replace(table, drives=(first, second), controller=None)


def linear(table: Machine, **modes: str) -> _core.LinearSystem:
    return _core.linearise(core_machine(table), modes=modes)


def slope(system: _core.LinearSystem, state: str, by: str) -> float:
    """Return ∂(dstate/dt)/∂by."""
    return float(system.A[system.states.index(state), system.states.index(by)])


def reads(system: _core.LinearSystem, signal: str, state: str) -> float:
    """Return ∂signal/∂state."""
    return float(system.C[system.signals.index(signal), system.states.index(state)])


# -------------------------------------------------------------------------- Eq. 1-4: the motor


def test_eq_1_each_emf_is_of_its_own_motor() -> None:
    system, table = linear(machine()), machine()
    for own, other in ((1, 2), (2, 1)):
        drive = table.drives[own - 1]
        assert slope(system, f"I_{own}", f"omega_c{own}") == pytest.approx(-drive.K_e / drive.L)
        assert slope(system, f"I_{own}", f"omega_c{other}") == 0


def test_eq_2_the_current_that_makes_torque_is_the_current_of_eq_1() -> None:
    """With I_dn a second current, U = R I would give no torque."""
    table = core_machine(machine())
    held = run(table, {"U_1": _core.constant(15.0)}, 0.5, signals=["U_1", "I_1", "T_1"])
    np.testing.assert_allclose(held["T_1"], 1.155 * held["I_1"], rtol=1e-14)
    assert held["T_1"][-1] > 1


def test_eq_3_the_reducer_multiplies_torque_and_reflects_inertia_squared() -> None:
    """M_n is what the rigid reducer of Eq. 4 needs, not elastic; i is motor over pinion angle."""
    system, table = linear(machine()), machine()
    drive = table.drives[0]
    assert "gearbox_1.twist" not in system.states
    assert reads(system, "omega_1", "omega_c1") == drive.i == 150
    right = drive.i * drive.K_d / (drive.i**2 * drive.J_d + drive.J_c)
    inverted = drive.K_d / drive.i / (drive.J_d / drive.i**2 + drive.J_c)
    assert slope(system, "omega_c1", "I_1") == pytest.approx(right)
    assert abs(right / inverted - 1) > 1


def test_eq_6_and_17_one_stiffness_acts_on_pinion_and_table() -> None:
    """With K_cn and K_tn different, action and reaction would differ."""
    system, table = linear(machine(), mesh_1="front", mesh_2="front"), machine()
    for n, drive in enumerate(table.drives, 1):
        on_pinion = drive.J * slope(system, f"omega_c{n}", f"mesh_{n}.twist")
        on_table = table.J_m * slope(system, "omega_m", f"mesh_{n}.twist")
        assert on_pinion == pytest.approx(-drive.K_t)
        assert on_table == pytest.approx(-table.i_m * on_pinion)


def test_eq_7_the_table_accelerates_by_its_own_speed_alone() -> None:
    system, table = linear(machine()), machine()
    assert slope(system, "omega_m", "omega_m") == pytest.approx(-table.b_m / table.J_m)
    assert slope(system, "omega_m", "omega_c1") == slope(system, "omega_m", "omega_c2") == 0


def test_eq_13_emf_and_torque_constants_are_reduced_alike() -> None:
    """K_e = i C_e and K_m = i K_d with K_d = C_e: electrical power becomes mechanical power."""
    system, table = linear(machine()), machine()
    for n, drive in enumerate(table.drives, 1):
        torque = drive.J * slope(system, f"omega_c{n}", f"I_{n}")
        emf = -drive.L * slope(system, f"I_{n}", f"omega_c{n}")
        assert torque == pytest.approx(emf)
        assert emf == pytest.approx(drive.i * drive.C_e)


def test_eq_14_emf_follows_speed_not_angle() -> None:
    """K_e θ_c as printed would brake a motor at rest by where it stands."""
    system = linear(machine(), mesh_1="front", mesh_2="front")
    for n in (1, 2):
        assert slope(system, f"I_{n}", "theta_m") == slope(system, f"I_{n}", f"mesh_{n}.twist") == 0
    at_rest = run(core_machine(machine()), end=0.1, initial={"theta_m": 1.0}, signals=["I_1"])
    assert np.abs(at_rest["I_1"]).max() == 0


# -------------------------------------------------------------------- Eq. 15-22: the dead zone


def test_eq_15_the_pinion_travels_twice_delta() -> None:
    """Δ, undefined in print, is half the play; the dead zone is one of x_n = θ_cn − i_m θ_m."""
    table = replace(machine().both(gap=1e-3, b_d=0, b_c=0, C_e=0), b_m=0)
    bounce = run(core_machine(table), end=0.5, initial={"omega_c1": 0.02}, rtol=1e-12)
    front, back = (next(c[0] for c in bounce.contacts if c[1:] == (1, 0, s)) for s in (1, -1))
    left = next(c[0] for c in bounce.contacts if c[1:] == (1, 1, 0))
    assert front == pytest.approx(1e-3 / 0.02)
    assert back - left == pytest.approx(
        2e-3 / 0.02, rel=1e-6
    )  # speed is kept by the table: no loss


def test_eq_17_the_selector_is_not_the_dead_zone_itself() -> None:
    """T = K φ with φ the dead zone; φ also as a factor of x would make torque quadratic."""
    system, table = linear(machine(), mesh_1="front"), machine()
    row, drive = system.signals.index("mesh_1.torque"), table.drives[0]
    torque = [
        system.C[row, system.states.index("mesh_1.twist")] * (drive.gap + d) + system.c[row]
        for d in (1e-5, 2e-5)
    ]
    assert torque[0] == pytest.approx(drive.K_t * 1e-5)
    assert torque[1] == pytest.approx(2 * torque[0])


def test_eq_19_the_back_flank_touches_softly_and_sees_the_pinion() -> None:
    """T = K (x + Δ) is zero at x = −Δ; with the printed +Δ it would be −2 K Δ there."""
    system, table = linear(machine(), mesh_1="back"), machine()
    row, twist = system.signals.index("mesh_1.torque"), system.states.index("mesh_1.twist")
    drive = table.drives[0]
    assert system.C[row, twist] * -drive.gap + system.c[row] == pytest.approx(0, abs=1e-9)
    faster = linear(machine().both(i=15.0), mesh_1="back")  # θ_n would make this ten times stiffer
    assert system.C[row, twist] == faster.C[row, twist] == drive.K_t


def test_eq_19_the_printed_cases_leave_the_back_flank_out() -> None:
    """Touching, x = −Δ, is in none of the printed cases; in the core both sides of it agree."""
    gap = machine().drives[0].gap
    x = -gap
    assert not any((x >= gap, abs(x) < gap, x < -gap))
    for mode in ("back", "gap"):
        system = linear(machine(), mesh_1=mode)
        row, twist = system.signals.index("mesh_1.torque"), system.states.index("mesh_1.twist")
        assert system.C[row, twist] * x + system.c[row] == pytest.approx(0, abs=1e-9)


# ------------------------------------------------------------------------- control and figures


def controlled(**changes: float) -> _core.LinearSystem:
    return _core.linearise(core_machine(heavy_table(dry_friction=False).control(**changes)))


def test_section_2_the_slave_is_speed_controlled() -> None:
    """An open-loop slave would not answer its own speed; only its position controller is off."""
    system = controlled()
    for n in (1, 2):
        assert reads(system, f"T_{n}*", f"omega_c{n}") == pytest.approx(-2e5 / 150)
    assert reads(system, "T_2*", "theta_m") == reads(system, "T_1*", "theta_m") < 0


def test_section_3_3_tension_acts_only_through_the_equaliser() -> None:
    """MD37256 is the equaliser's gain; the tension, MD37264, does nothing without it."""

    def pull(gain: float, tension: float) -> float:
        system = controlled(K_E=gain * 150 / (2 * 2e5), T_ten=tension, tau_t=0.0)
        offset = {n: system.c[system.signals.index(f"T_{n}*")] for n in (1, 2)}
        return float(offset[1] - offset[2])

    assert pull(0.5, 60) == pytest.approx(0.5 * 60)
    assert pull(1.0, 60) == pytest.approx(1.0 * 60)
    assert pull(0.5, 30) == pytest.approx(0.5 * 30)
    assert pull(0.0, 60) == 0


def test_the_gains_claimed_are_not_those_of_the_tables() -> None:
    """Table 1 and 2 in arcsec, old and new structure; 'more than 50 %' and 'more than 56 %'."""
    table_1, table_2 = [(8, 4), (5, 4), (4, 3)], [(8, 3), (9, 4), (10, 4)]
    gains = [[100 * (1 - new / old) for old, new in table] for table in (table_1, table_2)]
    assert gains[0] == pytest.approx([50, 20, 25])
    assert gains[1] == pytest.approx([62.5, 55.6, 60], abs=0.1)
    assert min(gains[0]) < 50
    assert min(gains[1]) < 56


def test_the_discs_of_table_2_do_not_weigh_what_is_printed() -> None:
    steel = 7850.0  # kg/m³
    weights = [pi / 4 * 1.25**2 * height * steel / 1e3 for height in (0.1, 0.4, 0.8)]
    assert weights == pytest.approx([1.0, 3.9, 7.7], abs=0.05)
    assert (
        max(weight / printed for weight, printed in zip(weights, (100, 250, 550), strict=True))
        < 0.02
    )


def test_torques_keep_their_signs_while_the_table_turns_back() -> None:
    """Section 2, reversal: what stays the same is the direction of M1's torque, not its "
    "rotation."""
    turns = [0.01, 0.0]
    motion = _core.cycle_of_moves(turns, 0.01, 0.01, 0.05, 1.0, 2.0, 1)
    held = run(core_machine(heavy_table()), {"theta_ref": motion}, 8.0,
               signals=["omega_1", "T_1", "T_2"])  # fmt: skip
    moves = held.t > 2.0
    assert held["omega_1"][moves].max() > 10
    assert held["omega_1"][moves].min() < -10
    assert held["T_1"][moves].min() > 0 > held["T_2"][moves].max()
