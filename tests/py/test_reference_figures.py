"""The reference model against figures found by others: the speed study and the design study.

Each figure was computed elsewhere, by another solver and another hand; none is this model's own.
"""

from __future__ import annotations

from functools import cache
from math import inf, pi, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

from reference_model import (
    Machine,
    Motion,
    Simulation,
    Trajectory,
    first_modes,
    heavy_table,
    move,
    simulate,
    sine,
    speed_study,
    step,
)

ARCSEC = pi / 180 / 3600


@cache
def studied(variant: str) -> Trajectory:
    return simulate(speed_study(variant), sine(0.02, 0.5), 10.0)


@pytest.mark.long
@pytest.mark.parametrize(("variant", "events"), [("S", 44), ("M", 85), ("H", 543), ("X", 1113)])
def test_contacts_of_the_speed_study(variant: str, events: int) -> None:
    """Every contact of ten seconds is found, and a finer grid moves none of them."""
    run = studied(variant)
    fine = simulate(speed_study(variant), sine(0.02, 0.5), 10.0, grid=5e-4)
    assert len(run.contacts) == len(fine.contacts) == events
    np.testing.assert_allclose(np.array(run.contacts), np.array(fine.contacts), atol=1e-11)
    peak = np.abs(run.X).max(axis=0)
    assert (np.abs(run.X - fine.X[::2]) / peak).max() < 1e-10


def test_chaos_of_impacts_amplifies_a_perturbation() -> None:
    run = studied("X")
    nudged = simulate(speed_study("X"), sine(0.02, 0.5), 10.0, perturbation=1e-12)
    spread = (np.abs(run.X - nudged.X) / np.abs(run.X).max(axis=0)).max()
    assert 1e-12 < spread < 1e-9


@pytest.mark.long
@pytest.mark.parametrize(
    ("load", "tension", "arcsec"),
    [(100, 0, 0.0), (250, 0, 35.0), (550, 0, 51.7), (250, 60, 0.0), (550, 60, 0.0)],
)
def test_hunting_of_the_heavy_table(load: int, tension: float, arcsec: float) -> None:
    """The study smoothed dry friction; with true sticking 51.7 reads 51.8."""
    machine = heavy_table(load).control(T_ten=tension)
    run = simulate(machine, move(0.02, 0.03, 0.01, 0.05, start=2.0), 14.0)
    assert np.ptp(run["error"][12000:]) / ARCSEC == pytest.approx(arcsec, rel=3e-3, abs=5e-3)


def limit_cycle(machine: Machine) -> tuple[float, float]:
    """Return frequency in Hz and half peak-to-peak in arcsec of the last 10 s of 30."""
    run = simulate(machine, step(1e-3), 30.0)
    t, angle = run.t[-10001:], run["theta_m"][-10001:]
    swing = angle - angle.mean()
    rising = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    half = float(np.ptp(angle)) / 2 / ARCSEC
    if half < 1e-2:
        return 0.0, half
    at = t[rising] - swing[rising] * (t[1] - t[0]) / np.diff(swing)[rising]
    return (len(at) - 1) / float(at[-1] - at[0]), half


def figure_4(K: float) -> Machine:
    machine = heavy_table(dry_friction=False)
    return machine.control(K_v=K, K_i=K / 0.5, k_p=8e4, T_N=0.1, T_ten=0.0)


@pytest.mark.parametrize(
    ("K", "hertz", "arcsec"), [(1, 0.38, 18.1), (6, 1.56, 20.5), (10, 2.13, 25.2)]
)
def test_limit_cycles_of_figure_4(K: float, hertz: float, arcsec: float) -> None:
    frequency, amplitude = limit_cycle(figure_4(K))
    assert frequency == pytest.approx(hertz, abs=0.005)
    assert amplitude == pytest.approx(arcsec, abs=0.05)


@pytest.mark.long
def test_no_limit_cycle_without_backlash_or_under_enough_tension() -> None:
    assert limit_cycle(figure_4(6).both(gap=0.0))[1] < 1e-6
    assert limit_cycle(figure_4(6).control(T_ten=5.0))[1] < 1e-6
    assert limit_cycle(figure_4(6).control(T_ten=3.0))[1] > 10


@pytest.mark.parametrize(("gap", "peak_to_peak"), [(0.55e-3, 20.49), (2.2e-3, 81.97)])
def test_limit_cycle_scales_with_the_gap(gap: float, peak_to_peak: float) -> None:
    """These figures belong to a current loop of 1000 1/s; 800 gives 41.09 arcsec at 1.555 Hz."""
    frequency, amplitude = limit_cycle(figure_4(6).control(omega_ci=1000.0).both(gap=gap))
    assert frequency == pytest.approx(1.551, abs=5e-4)
    assert 2 * amplitude == pytest.approx(peak_to_peak, abs=0.01)


@pytest.mark.parametrize(
    ("law", "lead", "figures", "tension"),
    [
        ({"K_v": 7.66, "K_i": 0.054, "K_d": 1.446, "k_p": 6580.0}, 1.0, (1.248, 1.550, 3.09), 17.5),
        ({"K_v": 3.707, "K_i": 0.046, "k_p": 16214.0}, 0.877, (1.244, 1.557, 3.100), 43.2),
    ],
)
def test_step_of_figure_5(
    law: dict[str, float], lead: float, figures: tuple[float, float, float], tension: float
) -> None:
    """Both readings: time from `lead` before the step, which follows 3 s of tensioning."""
    machine = heavy_table(dry_friction=False).control(
        **law, T_N=inf, K_E=0.5 * 150 / (2 * law["k_p"]), tau_t=0.05, Omega_E=0.2,
        Omega_max=1.047, f_v=0.0,
    )  # fmt: skip
    run = simulate(machine, step(1e-3, at=3.0), 13.0)
    t, y = run.t[3000:] - 3.0 + lead, run["theta_m"][3000:] / 1e-3
    settled = t[np.flatnonzero(np.abs(y - 1) > 0.02)[-1] + 1]
    crossings = np.flatnonzero(np.diff(np.sign(y - 1)))
    delay, rise, settling = figures
    assert t[np.argmax(y >= 0.5)] == pytest.approx(delay, abs=1.5e-3)
    assert t[np.argmax(y >= 1.0)] == pytest.approx(rise, abs=1.5e-3)
    assert settled == pytest.approx(settling, abs=6e-3)
    assert y.max() - 1 == pytest.approx(0.17, abs=5e-4)
    assert int((t[crossings] < settled).sum()) == 2
    assert 2 * 1.155 * run["I_1"][2999] == pytest.approx(tension, abs=0.05)


def flanks_met(run: Trajectory, since: float) -> list[tuple[int, int]]:
    """Return the pairs of flanks the machine goes through from a time on."""
    pairs = [tuple(pair) for pair in run.flanks()[run.t >= since].tolist()]
    return [pair for k, pair in enumerate(pairs) if k == 0 or pair != pairs[k - 1]]


def test_master_saturates_and_the_slave_changes_flank_in_figure_2() -> None:
    machine = heavy_table(550).both(T_max=100.0)
    run = simulate(machine, move(0.04, 0.05, 0.03, 0.06, start=2.0), 6.0)
    assert flanks_met(run, 1.9)[:3] == [(1, -1), (1, 0), (1, 1)]
    assert 1.155 * run["I_1"].max() == pytest.approx(100.0, abs=1e-6)
    assert 1.155 * run["I_2"].max() == pytest.approx(93, abs=1)


@pytest.mark.parametrize(("load", "hertz"), [(0, 11.6), (100, 9.0), (250, 6.5), (550, 4.9)])
def test_locked_rotor_frequency(load: int, hertz: float) -> None:
    machine = heavy_table(load)
    frequency = sqrt(2 * 2e7 * machine.i_m**2 / machine.J_m) / (2 * pi)
    assert frequency == pytest.approx(hertz, abs=0.05)


@pytest.mark.parametrize(("current_loop", "critical"), [(800.0, 16.4), (1e5, 17.6)])
def test_critical_position_gain(current_loop: float, critical: float) -> None:
    """Both flanks always closed, 550 t: the gain at which a pair of poles turns unstable."""

    def growth(K_v: float) -> float:
        machine = heavy_table(550, dry_friction=False).both(gap=0.0)
        machine = machine.control(K_v=K_v, omega_ci=current_loop)
        mode = Simulation(machine, Motion(), 1e-3).mode(first_modes(machine, {}))
        return float(np.linalg.eigvals(mode.A).real.max()) - 1e-9

    assert brentq(growth, 10.0, 30.0) == pytest.approx(critical, abs=0.05)
