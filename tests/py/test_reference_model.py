"""The reference model against closed forms and against the printed Eq. 23."""

from __future__ import annotations

from dataclasses import replace
from math import inf, pi, sqrt

import numpy as np
import pytest

from reference_model import (
    Array,
    Drive,
    Machine,
    Motion,
    Simulation,
    heavy_table,
    load_ramp,
    move,
    simulate,
)

ARCSEC = pi / 180 / 3600
SIDES = {-1: "back", 0: "gap", 1: "front"}


# ------------------------------------------------------------------- Eq. 23, right and as printed


def drives_apart() -> Machine:
    """Return a machine whose two drives differ in everything, without losses."""
    first = Drive(1, 1.0, 0, 0, 0, 0.8, 0.8, 0.0, 0.05, 900.0, 0.01)
    second = Drive(1, 1.2, 0, 0, 0, 0.7, 0.7, 0.0, 0.06, 1000.0, 0.012)
    return Machine((first, second), 4.0, 40.0, 0.0)


def eq23(machine: Machine, sides: tuple[int, int]) -> tuple[Array, Array]:
    """Return A' and C v of Eq. 23 corrected, from its rank-one form A0 − k gᵀ."""
    A, Cv = np.zeros((8, 8)), np.zeros(8)
    A[6, 7], A[7, 7] = 1, -machine.b_m / machine.J_m
    for n, (drive, side) in enumerate(zip(machine.drives, sides, strict=True)):
        A[n, n], A[n, 4 + n], A[2 + n, n] = -drive.b / drive.J, drive.K_m / drive.J, 1
        A[4 + n, n], A[4 + n, 4 + n] = -drive.K_e / drive.L, -drive.R / drive.L
        g, k = np.zeros(8), np.zeros(8)
        g[2 + n], g[6] = 1, -machine.i_m
        k[n], k[7] = drive.K_t / drive.J, -machine.i_m * drive.K_t / machine.J_m
        A -= abs(side) * np.outer(k, g)
        Cv += abs(side) * k * side * drive.gap
    return A, Cv


def as_printed(
    machine: Machine,
) -> dict[str, tuple[dict[tuple[int, int], float], dict[int, float]]]:
    """Return each misprint of Eq. 22 and 23 as entries of A' and of C v, both flanks in front."""
    (one, two), i_m, J_m = machine.drives, machine.i_m, machine.J_m
    return {
        "A'(1,5)": ({(0, 4): one.K_t / one.J}, {}),
        "A'(2,6)": ({(1, 5): two.K_t / two.J}, {}),
        "A'(5,1)": ({(4, 0): -two.K_e / one.L}, {}),
        "A'(8,7)": ({(7, 6): (one.K_t + two.K_t) * i_m**2 / J_m}, {}),
        "C(1,1)": ({}, {0: -one.K_t / one.J * one.gap}),
        "C(2,2)": ({}, {1: -two.K_t / two.J * two.gap}),
        "C(8,.)": ({}, {7: one.K_t / one.J * one.gap + two.K_t / two.J * two.gap}),
        "beta_1 twice in Eq. 22": ({}, {7: -i_m * (one.K_t + two.K_t) * one.gap / J_m}),
    }


def energy_leak(machine: Machine, A: Array) -> float:
    """Return the largest entry of PA + AᵀP, SI units: zero if the energy ½ XᵀPX is conserved."""
    P = np.zeros((8, 8))
    P[7, 7] = machine.J_m
    for n, drive in enumerate(machine.drives):
        g = np.zeros(8)
        g[2 + n], g[6] = 1, -machine.i_m
        P[n, n], P[4 + n, 4 + n] = drive.J, drive.L
        P += drive.K_t * np.outer(g, g)
    return float(np.abs(P @ A + A.T @ P).max())


def touching(machine: Machine) -> Array:
    """Return the machine at rest, both front flanks just touching."""
    return np.array([0, 0, machine.drives[0].gap, machine.drives[1].gap, 0, 0, 0, 0])


@pytest.mark.parametrize("sides", [(a, b) for a in SIDES for b in SIDES])
def test_each_contact_mode_is_eq_23_corrected(sides: tuple[int, int]) -> None:
    machine = heavy_table(250, dry_friction=False).both(c=0.0)
    machine = replace(
        machine, controller=None, drives=(machine.drives[0], replace(machine.drives[1], gap=2e-3))
    )
    modes = {f"mesh_{n}": SIDES[side] for n, side in enumerate(sides, 1)}
    mode = Simulation(machine, Motion(), 1e-3).mode(modes)
    to_twist = np.eye(8)
    to_twist[2:4, 6] = -machine.i_m  # x_n = θ_cn − i_m θ_m
    A, Cv = eq23(machine, sides)
    np.testing.assert_allclose(mode.A[:8, :8], to_twist @ A @ np.linalg.inv(to_twist), rtol=1e-12)
    np.testing.assert_allclose(mode.A[:8, -1], Cv, rtol=1e-12)  # rates of ω and I: no twist in them


def test_corrected_eq_23_keeps_energy_and_touches_softly() -> None:
    machine = drives_apart()
    A, Cv = eq23(machine, (1, 1))
    assert energy_leak(machine, A) < 1e-10
    assert np.abs(A @ touching(machine) + Cv).max() < 1e-12


@pytest.mark.parametrize("misprint", list(as_printed(drives_apart())))
def test_each_misprint_breaks_a_law_of_nature(misprint: str) -> None:
    machine = drives_apart()
    A, Cv = eq23(machine, (1, 1))
    wrong, offset = as_printed(machine)[misprint]
    for entry, value in wrong.items():
        A[entry] = value
    for row, value in offset.items():
        Cv[row] = value
    if wrong:
        assert energy_leak(machine, A) > 0.05
    else:  # a flank that just touches transmits nothing
        assert np.abs(A @ touching(machine) + Cv).max() > 0.01


def test_printed_matrix_has_an_unstable_pole_without_any_source_of_energy() -> None:
    machine = drives_apart()
    A, _ = eq23(machine, (1, 1))
    assert np.linalg.eigvals(A).real.max() < 1e-4  # a double pole at the origin, to rounding
    for wrong, _ in as_printed(machine).values():
        for entry, value in wrong.items():
            A[entry] = value
    assert np.linalg.eigvals(A).real.max() == pytest.approx(28.5, abs=0.05)


def test_printed_offset_of_the_back_flank_jumps() -> None:
    """Eq. 19 and 21 print β = +Δ on the back flank, where touching would then pull with 2 K Δ."""
    drive = drives_apart().drives[0]
    corrected, printed = (drive.K_t * (-drive.gap - beta) for beta in (-drive.gap, drive.gap))
    assert corrected == 0
    assert printed == pytest.approx(-2 * drive.K_t * drive.gap)


# --------------------------------------------------------------------------------- closed forms


def free_bounce(K: tuple[float, float] = (2e7, 0.0)) -> Machine:
    """Return the heavy table without any loss, motor or controller."""
    machine = heavy_table(dry_friction=False)
    drive = replace(machine.drives[0], b_d=0, b_c=0, c=0, K_d=0, C_e=0)
    drives = (replace(drive, K_t=K[0]), replace(drive, K_t=K[1]))
    return replace(machine, drives=drives, b_m=0, controller=None)


def test_period_of_a_free_bounce() -> None:
    machine, v = free_bounce(), 0.01
    drive = machine.drives[0]
    omega = sqrt(drive.K_t * (1 / drive.J + machine.i_m**2 / machine.J_m))
    run = simulate(machine, Motion(), 2.0, start={"omega_c1": v})
    front = np.array([t for t, mesh, _, after in run.contacts if (mesh, after) == (1, 1)])
    np.testing.assert_allclose(np.diff(front), 2 * pi / omega + 4 * drive.gap / v, rtol=1e-12)
    assert 2 * pi / omega + 4 * drive.gap / v == pytest.approx(0.483036843, abs=5e-10)


def test_energy_is_kept_without_losses() -> None:
    """Kinetic, mesh and magnetic energy of an undamped machine through many impacts."""
    machine = heavy_table(dry_friction=False).both(R=0, b_d=0, b_c=0, c=0)
    machine = replace(machine, b_m=0, controller=None)
    run = simulate(machine, Motion(), 5.0, start={"omega_c1": 0.3, "omega_c2": -0.2, "I_1": 20.0})
    energy = 0.5 * machine.J_m * run["omega_m"] ** 2
    for n, drive in enumerate(machine.drives, 1):
        pressed = run[f"x_{n}"] - np.clip(run[f"x_{n}"], -drive.gap, drive.gap)
        energy = energy + 0.5 * drive.J * run[f"omega_c{n}"] ** 2 + 0.5 * drive.K_t * pressed**2
        energy = energy + 0.5 * drive.L * run[f"I_{n}"] ** 2
    assert len(run.contacts) > 50
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


def test_damped_impact_never_pulls() -> None:
    """A pinion hits the locked ring: K x + c ẋ reaches zero before x does, and it leaves then."""
    machine = free_bounce()
    machine = replace(machine.both(c=4e4), J_m=inf)
    drive, v = machine.drives[0], 0.02
    omega = sqrt(drive.K_t / drive.J)
    zeta = drive.c / (2 * drive.J * omega)
    damped = omega * sqrt(1 - zeta**2)
    held = (pi + np.arctan2(-2 * zeta * damped, omega * (1 - 2 * zeta**2))) / damped
    left = v * np.exp(-zeta * omega * held)
    left *= np.cos(damped * held) - zeta * omega / damped * np.sin(damped * held)
    run = simulate(machine, Motion(), 0.2, start={"omega_c1": v})
    made, lost = (contact[0] for contact in run.contacts[:2])
    assert made == pytest.approx(drive.gap / v, rel=1e-13)
    assert lost - made == pytest.approx(held, rel=1e-11)
    assert run["omega_c1"][-1] == pytest.approx(left, rel=1e-11)
    assert run["mesh_torque_1"].min() >= 0


def test_dry_friction_stops_holds_and_lets_go() -> None:
    """A free table stops after Jω/T, stays put, and a growing load moves it at its own level."""
    forward, backward, speed, rate = 3e3, 5e3, 2e-3, 100.0
    machine = replace(free_bounce(), friction=(forward, backward)).both(gap=1.0)
    stop = machine.J_m * speed / forward
    run = simulate(machine, load_ramp(rate, start=4.0), 60.0, grid=1e-2, start={"omega_m": speed})
    changes = [(event.t, event.after) for event in run.events if event.element == "table"]
    assert changes[0][1] == "stuck"
    assert changes[1][1] == "backward"
    assert changes[0][0] == pytest.approx(stop, rel=1e-12)
    assert changes[1][0] == pytest.approx(4.0 + backward / rate, rel=1e-12)
    rest = machine.J_m * speed**2 / (2 * forward)
    np.testing.assert_allclose(run["theta_m"][400:5300], rest, rtol=1e-11)
    slip = run.t[-1] - 4.0 - backward / rate  # J θ̈ = −rate·t after the break-away
    assert run["theta_m"][-1] == pytest.approx(rest - rate * slip**3 / (6 * machine.J_m), rel=1e-9)


def test_stiffness_halves_when_a_flank_opens() -> None:
    """Both pinions locked and braced by i T_ten / 2; the load is ramped slowly."""
    machine = heavy_table(dry_friction=False).both(c=0, J_c=inf)
    drive, i_m = machine.drives[0], machine.i_m
    tension, rate = drive.i * 60 / 2, 2e3
    braced = drive.gap + tension / drive.K_t
    machine = replace(machine, b_m=2e7, controller=None)
    run = simulate(machine, load_ramp(rate), 150, grid=1e-2, start={"x_1": braced, "x_2": -braced})
    opening = next(contact for contact in run.contacts if contact[3] == 0)
    lag = rate * machine.b_m / (2 * drive.K_t * i_m**2)  # load the viscous table lags behind
    assert rate * opening[0] - lag == pytest.approx(2 * i_m * tension, rel=1e-9)
    assert 2 * i_m * tension == pytest.approx(1.8e5)
    turned = np.interp(opening[0], run.t, -run["theta_m"])
    assert turned / ARCSEC == pytest.approx(2.32, abs=0.005)
    slope = np.gradient(run["T_load"], -run["theta_m"])
    assert slope[8000] == pytest.approx(2 * drive.K_t * i_m**2, rel=1e-6)
    assert slope[12000] == pytest.approx(drive.K_t * i_m**2, rel=1e-6)


def test_move_keeps_its_limits_and_arrives() -> None:
    for distance, v, a, j in ((0.02, 0.03, 0.01, 0.05), (-0.4, 0.05, 0.03, 0.06), (1e-5, 1, 1, 1)):
        machine = replace(heavy_table(dry_friction=False), friction=(0.0, 0.0))
        motion = move(distance, v, a, j, start=0.25, origin=0.1)
        end = motion.breakpoints[-1][0]
        run = simulate(machine, motion, round(end + 0.2, 2), grid=1e-2, start={"theta_ref": 0.1})
        assert np.abs(run["omega_ref"]).max() <= v * (1 + 1e-12)
        assert np.abs(run["alpha_ref"]).max() <= a * (1 + 1e-12)
        np.testing.assert_allclose(run["theta_ref"][-1], 0.1 + distance, rtol=1e-12)
        last = motion.breakpoints[-2][1]
        remaining = end - motion.breakpoints[-2][0]
        assert last["omega_ref"] + last["alpha_ref"] * remaining + last[
            "jerk_ref"
        ] * remaining**2 / 2 == pytest.approx(0, abs=1e-15)
