"""The reference model against its law written once more for a step-by-step solver.

Here the angles are absolute, contacts and limits are plain clips, dry friction is smoothed and
no event is located: nothing but the law is shared with the reference model.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from reference_model import (
    Array,
    Machine,
    Trajectory,
    bench,
    heavy_table,
    move,
    simulate,
    sine,
    speed_study,
    step,
)


def sign_of_tanh(speed: float, friction: tuple[float, float], width: float) -> float:
    return friction[int(speed < 0)] * float(np.tanh(speed / width))


def step_rates(machine: Machine, wanted: tuple[float, float], z: Array, smooth: float) -> Array:
    """Return ż of plant and controller written as one would for any ODE solver, absolute angles.

    Dry friction is smoothed over the table speed `smooth`; contacts and limits are plain clips.
    """
    law, (command, command_speed) = machine.controller, wanted
    assert law is not None
    omega, theta, current = z[0:2], z[2:4], z[4:6]
    table, speed = z[6], z[7]
    following, lag, tension, equaliser = z[8:12]
    speed_loop, current_loop = z[12:14], z[14:16]
    dz = np.zeros(16)

    def integrates(raw: float, top: float, rate: float) -> float:
        return 0.0 if abs(raw) > top and raw * rate > 0 else rate

    error = command - table
    dz[9] = (error - lag) / law.tau_d
    raw = machine.i_m * (
        law.K_v * error + law.K_i * following + law.K_d * dz[9] + law.f_v * command_speed
    )
    dz[8] = integrates(raw, law.Omega_max, error)
    set_speed = np.clip(raw, -law.Omega_max, law.Omega_max)
    dz[10] = (law.T_ten - tension) / law.tau_t if law.tau_t else 0.0
    tension = tension if law.tau_t else law.T_ten
    motor = [drive.K_d * current[n] for n, drive in enumerate(machine.drives)]
    unequal = 2 * (law.w * motor[0] - (1 - law.w) * motor[1]) - tension
    raw = law.K_E * (unequal + equaliser)
    dz[11] = integrates(raw, law.Omega_E, unequal / law.T_E)
    y = np.clip(raw, -law.Omega_E, law.Omega_E)
    driving = -machine.b_m * speed - sign_of_tanh(speed, machine.friction, smooth)
    for n, drive in enumerate(machine.drives):
        slip = set_speed + law.equalises[n] * y - omega[n]
        if law.omega_ci is None:
            voltage = law.k_p * (slip + speed_loop[n])
            dz[12 + n] = slip / law.T_N
        else:
            raw = law.k_p / drive.i * (slip + speed_loop[n])
            dz[12 + n] = integrates(raw, drive.T_max, slip / law.T_N)
            lack = np.clip(raw, -drive.T_max, drive.T_max) / drive.K_d - current[n]
            raw = law.omega_ci * (drive.L * lack + drive.R * current_loop[n])
            raw += drive.K_e * omega[n]
            dz[14 + n] = integrates(raw, drive.U_max, lack)
            voltage = np.clip(raw, -drive.U_max, drive.U_max)
        x, closing = theta[n] - machine.i_m * table, omega[n] - machine.i_m * speed
        torque = 0.0
        if abs(x) > drive.gap:
            side = np.sign(x)
            torque = drive.K_t * (x - side * drive.gap) + drive.c * closing
            torque = side * max(0.0, side * torque)
        rub = sign_of_tanh(omega[n], drive.friction, machine.i_m * smooth)
        dz[n] = (drive.K_m * current[n] - drive.b * omega[n] - torque - rub) / drive.J
        dz[2 + n] = omega[n]
        dz[4 + n] = (voltage - drive.R * current[n] - drive.K_e * omega[n]) / drive.L
        driving += machine.i_m * torque
    dz[6], dz[7] = speed, driving / machine.J_m
    return dz


def commanded(run: Trajectory) -> Callable[[float], tuple[float, float]]:
    """Return the command of a run as a function of time (cubic between the samples)."""
    spline = CubicHermiteSpline(run.t, run["command"], run["command_speed"])
    slope = spline.derivative()
    return lambda t: (float(spline(t)), float(slope(t)))


def apart(run: Trajectory, X: Array) -> float:
    """Return the largest difference of the eight plant states, each over its own peak."""
    return float((np.abs(run.X - X).max(axis=0) / np.abs(run.X).max(axis=0)).max())


def test_adaptive_solver_agrees_on_the_speed_study() -> None:
    machine = speed_study("S")
    run = simulate(machine, sine(0.02, 0.5), 2.0)
    turn = 2 * pi * 0.5
    solution = solve_ivp(
        lambda t, z: step_rates(
            machine, (0.02 * np.sin(turn * t), 0.02 * turn * np.cos(turn * t)), z, 1e-5
        ),
        (0, 2.0), np.zeros(16), "DOP853", run.t, rtol=1e-9, atol=1e-11, max_step=2e-3,
    )  # fmt: skip
    assert len(run.contacts) > 5
    assert apart(run, solution.y[:8].T) < 1e-6


@pytest.mark.long
def test_fixed_steps_agree_on_every_limit_and_damping() -> None:
    """All limits are met: Ω, equaliser, torque and voltage, with anti-windup that slides."""
    machine = bench().both(T_max=0.25, U_max=14.0).control(Omega_max=6.0, Omega_E=0.05, K_i=20.0)
    motion = step(0.4, at=0.2) + move(-0.3, 2.0, 20.0, 400.0, start=0.9, origin=0.4)
    run = simulate(machine, motion, 1.5)
    command, width = commanded(run), 1e-3 / 20
    z, states = np.zeros(16), []
    jump = round(0.2 / width)
    for k in range(1500 * 20):
        if k % 20 == 0:
            states.append(z)
        now = [
            (0.0, 0.0) if k < jump else command(max(t, 0.201))
            for t in (k * width, (k + 0.5) * width, (k + 1) * width)
        ]
        a = step_rates(machine, now[0], z, 1e-5)
        b = step_rates(machine, now[1], z + width / 2 * a, 1e-5)
        c = step_rates(machine, now[1], z + width / 2 * b, 1e-5)
        d = step_rates(machine, now[2], z + width * c, 1e-5)
        z = z + width / 6 * (a + 2 * b + 2 * c + d)
    met = {(event.element, event.after) for event in run.events}
    assert {"following", "equaliser", "speed_1", "current_1"} <= {element for element, _ in met}
    assert any(after.endswith("slides") for _, after in met)
    assert apart(run, np.array([*states, z])[:, :8]) < 1e-3  # 4e-4 seen, shrinking with the step
    assert np.abs(run["T_set_1"]).max() <= 0.25 * (1 + 1e-12)
    assert np.abs(run["U_1"]).max() <= 14.0 * (1 + 1e-12)


@pytest.mark.long
def test_smoothed_friction_hunts_as_the_study_found() -> None:
    """True sticking, the limit of a narrow tanh, moves the study's 51.7 arcsec by 0.2 %."""
    machine = heavy_table(550).control(T_ten=0.0)
    run = simulate(machine, move(0.02, 0.03, 0.01, 0.05, start=2.0), 14.0)
    command = commanded(run)
    solution = solve_ivp(
        lambda t, z: step_rates(machine, command(t), z, 2e-5),
        (0, 14.0), np.zeros(16), "LSODA", run.t, rtol=1e-8, atol=1e-10, max_step=5e-3,
    )  # fmt: skip
    late = slice(12000, None)
    smoothed = np.ptp(run["command"][late] - solution.y[6, late]) * 180 * 3600 / pi
    stuck = np.ptp(run["error"][late]) * 180 * 3600 / pi
    assert smoothed == pytest.approx(51.7, abs=0.05)
    assert stuck == pytest.approx(smoothed, rel=3e-3)
