"""Oracles 1 to 3: the core against closed forms and against figures found by other solvers."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from core_machines import Array, Run, core_machine, locked_pinions, run, run_like
from dualdrive import _core
from reference_model import Machine, heavy_table, step

pytestmark = pytest.mark.usefixtures("both_engines")

ARCSEC = pi / 180 / 3600


# -------------------------------------------------------------- oracle 1: a free bounce in a gap


def free_bounce() -> Machine:
    machine = heavy_table(dry_friction=False)
    lone = replace(machine.drives[0], b_d=0, b_c=0, c=0, C_e=0)
    return replace(
        machine, drives=(lone, replace(lone, K_t=1e-9)), b_m=0, controller=None
    )  # a second spring of 1e-9 N m/rad is none


@pytest.mark.parametrize(("method", "rtol"), [("adams", 1e-12), ("bdf", 1e-13)])
def test_period_of_a_free_bounce(method: str, rtol: float) -> None:
    """2π/ω_r + 4Δ/v0 with ω_r² = K (1/J_n + i_m²/J_m)."""
    machine, v = free_bounce(), 0.01
    drive = machine.drives[0]
    omega = sqrt(drive.K_t * (1 / drive.J + machine.i_m**2 / machine.J_m))
    period = 2 * pi / omega + 4 * drive.gap / v
    assert period == pytest.approx(0.483036843, abs=5e-10)
    bounce = run(core_machine(machine), end=3.0, initial={"omega_c1": v}, rtol=rtol, method=method)
    front = [t for t, mesh, _, after in bounce.contacts if (mesh, after) == (1, 1)]
    assert len(front) == 6
    np.testing.assert_allclose(np.diff(front), period, rtol=0, atol=1e-8)


def test_period_of_a_free_bounce_at_the_default_tolerance() -> None:
    bounce = run(core_machine(free_bounce()), end=3.0, initial={"omega_c1": 0.01})
    front = [t for t, mesh, _, after in bounce.contacts if (mesh, after) == (1, 1)]
    np.testing.assert_allclose(np.diff(front), 0.483036843, rtol=0, atol=1e-7)


# ------------------------------------------------------ oracle 2: stiffness with pinions locked


def braced_table(tension: float = 60.0) -> tuple[_core.Machine, dict[str, float]]:
    """Return the table held by two locked pinions, and the twists that brace it."""
    K, i, gap = 2e7, 150, 1.1e-3
    machine = locked_pinions()
    for name, value in (("ratio", 20.0), ("stiffness", K), ("gap", gap)):
        machine.set(f"meshes.{name}", value)
    machine.set("table.J", 3e6)
    machine.set("table.b", 2e7)  # an overdamped table follows the slow ramp
    twist = gap + i * tension / 2 / K
    return machine, {"mesh_1.twist": twist, "mesh_2.twist": -twist}


def test_stiffness_halves_when_a_flank_opens() -> None:
    """2 K i_m² below T = 2 i_m (i T_ten / 2) = 1.8e5 N m, 2.32 arcsec; K i_m² above."""
    machine, initial = braced_table()
    rate, K, i_m = 2e3, 2e7, 20.0
    ramp = run(machine, {"T_load": _core.ramp(rate)}, 150.0, initial=initial, output_step=1e-2)
    opening = next(contact for contact in ramp.contacts if contact[3] == 0)
    lag = rate * machine.get("table.b") / (2 * K * i_m**2)  # load the viscous table lags behind
    assert rate * opening[0] - lag == pytest.approx(1.8e5, rel=1e-8)
    turned = np.interp(opening[0], ramp.t, -ramp["theta_m"])
    assert turned == pytest.approx(1.8e5 / (2 * K * i_m**2), rel=1e-6)
    assert turned / ARCSEC == pytest.approx(2.32, abs=0.005)
    for since, until, stiffness in ((2000, 8000, 2 * K * i_m**2), (10000, 15000, K * i_m**2)):
        load, angle = (ramp[name][[since, until]] for name in ("T_load", "theta_m"))
        assert np.diff(load) / -np.diff(angle) == pytest.approx(stiffness, rel=1e-7)


# ------------------------------------------------------- oracle 3: limit cycle of Figure 4, K = 6


def limit_cycle(machine: Machine) -> tuple[float, float]:
    """Return frequency in Hz and peak-to-peak in arcsec of the last 10 s of 30."""
    cycle = run_like(machine, step(1e-3), 30.0)
    t, angle = cycle.t[20000:], cycle["theta_m"][20000:]
    return frequency(t, angle), float(np.ptp(angle)) / ARCSEC


def frequency(t: Array, angle: Array) -> float:
    swing = angle - angle.mean()
    rising = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    at = t[rising] - swing[rising] * (t[1] - t[0]) / np.diff(swing)[rising]
    return float((len(at) - 1) / (at[-1] - at[0]))


def figure_4(bandwidth: float, gap: float = 1.1e-3) -> Machine:
    machine = heavy_table(dry_friction=False).both(gap=gap)
    return machine.control(K_v=6, K_i=12, k_p=8e4, T_N=0.1, T_ten=0.0, omega_ci=bandwidth)


@pytest.mark.parametrize(
    ("gap", "peak_to_peak"), [(0.55e-3, 20.49), (1.1e-3, 40.98), (2.2e-3, 81.97)]
)
def test_limit_cycle_scales_with_the_gap(gap: float, peak_to_peak: float) -> None:
    hertz, amplitude = limit_cycle(figure_4(1000.0, gap))
    assert hertz == pytest.approx(1.551, abs=5e-4)
    assert amplitude == pytest.approx(peak_to_peak, abs=0.01)


def test_limit_cycle_of_the_default_current_loop() -> None:
    hertz, amplitude = limit_cycle(figure_4(800.0))
    assert hertz == pytest.approx(1.555, abs=5e-4)
    assert amplitude == pytest.approx(41.09, abs=0.01)


def test_signals_are_named_in_the_order_of_eq_23() -> None:
    bounce: Run = run(core_machine(free_bounce()), end=0.01, initial={"omega_c1": 0.01})
    assert bounce.X.shape == (11, 8)
    np.testing.assert_array_equal(bounce.X[0], [0.01, 0, 0, 0, 0, 0, 0, 0])
