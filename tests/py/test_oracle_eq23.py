"""Eq. 22/23 is one instance of the core: its nine contact modes, built from assemblies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core_machines import Array, core_machine
from dualdrive import _core
from reference_model import Machine, heavy_table
from test_reference_model import SIDES, as_printed, drives_apart, eq23

X = ("omega_c1", "omega_c2", "theta_c1", "theta_c2", "I_1", "I_2", "theta_m", "omega_m")


def in_paper_states(system: _core.LinearSystem) -> tuple[Array, Array]:
    """Return A' and the offset of Ẋ = A' X + ..., X = P z made of the core's own signals."""
    P = np.array([system.C[system.signals.index(name)] for name in X])
    np.testing.assert_array_equal([system.c[system.signals.index(name)] for name in X], 0)
    return P @ system.A @ np.linalg.inv(P), P @ system.a


def core_eq23(machine: Machine, sides: tuple[int, int]) -> tuple[Array, Array]:
    modes = {f"mesh_{n}": SIDES[side] for n, side in enumerate(sides, 1)}
    return in_paper_states(_core.linearise(core_machine(machine), modes=modes))


def unequal_heavy_table() -> Machine:
    machine = heavy_table(250, dry_friction=False).both(c=0.0)
    first, second = machine.drives
    second = replace(second, gap=2e-3, K_t=1.7e7, J_d=0.05, b_c=150.0, C_e=1.2, K_d=1.1, R=0.2)
    return replace(machine, controller=None, drives=(first, second))


@pytest.mark.parametrize("machine", [unequal_heavy_table(), drives_apart()])
@pytest.mark.parametrize("sides", [(a, b) for a in SIDES for b in SIDES])
def test_each_contact_mode_is_eq_23_corrected(machine: Machine, sides: tuple[int, int]) -> None:
    A, Cv = eq23(machine, sides)
    core, offset = core_eq23(machine, sides)
    np.testing.assert_allclose(core, A, rtol=1e-12, atol=1e-13 * np.abs(A).max())
    np.testing.assert_allclose(offset, Cv, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("misprint", list(as_printed(drives_apart())))
def test_no_printed_entry_is_the_core_s(misprint: str) -> None:
    machine = drives_apart()
    A, Cv = core_eq23(machine, (1, 1))
    entries, offsets = as_printed(machine)[misprint]
    for entry, value in entries.items():
        assert abs(A[entry] - value) > 0.1 * abs(value)
    for row, value in offsets.items():
        assert abs(Cv[row] - value) > 0.01 * abs(value)


def test_voltages_enter_through_the_inductances_alone() -> None:
    """B' = e_5 / L_1, e_6 / L_2."""
    machine = unequal_heavy_table()
    for n, drive in enumerate(machine.drives, 1):
        driven = _core.linearise(core_machine(machine), {f"U_{n}": _core.constant(1.0)})
        expected = np.zeros(8)
        expected[3 + n] = 1 / drive.L
        np.testing.assert_allclose(in_paper_states(driven)[1], expected, rtol=1e-14)


def test_guards_are_the_gaps_in_pinion_angle() -> None:
    """g_nᵀ X = θ_cn − i_m θ_m; mesh torque and deflection follow from it."""
    machine = unequal_heavy_table()
    system = _core.linearise(core_machine(machine), modes={"mesh_1": "back"})
    P = np.array([system.C[system.signals.index(name)] for name in X])
    row = system.C[system.signals.index("mesh_1.deflection")] @ np.linalg.inv(P)
    np.testing.assert_allclose(row, [0, 0, 1, 0, 0, 0, -machine.i_m, 0], atol=1e-15)
    torque = system.signals.index("mesh_1.torque")
    drive = machine.drives[0]
    assert system.c[torque] == pytest.approx(drive.K_t * drive.gap)
    np.testing.assert_allclose(
        system.C[torque], drive.K_t * system.C[system.signals.index("mesh_1.twist")]
    )


def test_a_wrong_mode_is_refused() -> None:
    machine = core_machine(drives_apart())
    with pytest.raises(ValueError, match=r"mesh_1 has no mode 'middle'; choose one of .*front"):
        _core.linearise(machine, modes={"mesh_1": "middle"})
    with pytest.raises(ValueError, match=r"no switching element named mesh_3"):
        _core.linearise(machine, modes={"mesh_3": "front"})
    with pytest.raises(ValueError, match=r"no state omega_c3"):
        _core.linearise(machine, state={"omega_c3": 1.0})
