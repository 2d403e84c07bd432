"""The case in other people's solvers, each written as well as its interface allows.

One right-hand side, compiled by Numba, in the same coordinates that dualdrive integrates (twists of
the meshes, not absolute angles), with the exact Jacobian where a method takes one, absolute
tolerances scaled to each state, and the contacts as events that are located but stop nothing.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import numpy as np

from case import AMPLITUDE, FREQUENCY, SPAN, Array, Engine, grid, machine

# omega_c1, omega_c2, x_1, x_2, I_1, I_2, theta_m, omega_m, two speed integrals, equaliser integral
STATES = 11


def _constants() -> tuple[float, ...]:
    m = machine()
    drive, law = m.drives[0], m.controller
    assert law is not None
    return (
        drive.J, drive.b, drive.K_m, drive.K_e, drive.R, drive.L, drive.K_t, drive.gap, m.i_m,
        m.J_m, m.b_m, law.K_v, law.f_v, law.k_p, law.k_p / law.T_N, law.K_E, law.K_E / law.T_E,
        law.T_ten, AMPLITUDE, 2 * pi * FREQUENCY,
    )  # fmt: skip


def compiled() -> tuple[Any, Any, Any]:
    """Return f(t, y, out), J(t, y, out) and f(t, y) -> out, compiled."""
    from numba import njit

    (J, b, K_m, K_e, R, L, K_t, gap, i_m, J_m, b_m, K_v, f_v, k_p, k_i, K_E, k_E, T_ten,
     size, turn) = _constants()  # fmt: skip

    @njit
    def flank(x):  # type: ignore[no-untyped-def]  # torque of a mesh, Eq. 15-17 corrected
        if x > gap:
            return K_t * (x - gap)
        if x < -gap:
            return K_t * (x + gap)
        return 0.0

    @njit
    def rates(t, y, out):  # type: ignore[no-untyped-def]
        T_1, T_2 = flank(y[2]), flank(y[3])
        command, speed = size * sin(turn * t), size * turn * cos(turn * t)
        Omega_1 = i_m * (K_v * (command - y[6]) + f_v * speed)
        e_T = K_m * (y[4] - y[5]) - T_ten
        e_1 = Omega_1 - y[0]
        e_2 = Omega_1 + K_E * e_T + k_E * y[10] - y[1]
        out[0] = (K_m * y[4] - b * y[0] - T_1) / J
        out[1] = (K_m * y[5] - b * y[1] - T_2) / J
        out[2] = y[0] - i_m * y[7]
        out[3] = y[1] - i_m * y[7]
        out[4] = (k_p * e_1 + k_i * y[8] - R * y[4] - K_e * y[0]) / L
        out[5] = (k_p * e_2 + k_i * y[9] - R * y[5] - K_e * y[1]) / L
        out[6] = y[7]
        out[7] = (i_m * (T_1 + T_2) - b_m * y[7]) / J_m
        out[8], out[9], out[10] = e_1, e_2, e_T

    @njit
    def jacobian(t, y, out):  # type: ignore[no-untyped-def]
        """The field is affine between contacts, so a difference over any step is exact."""
        at, rate, base = y.copy(), np.zeros(STATES), np.zeros(STATES)
        rates(t, at, base)
        for k in range(STATES):
            if k == 2 or k == 3:
                slope = K_t if abs(y[k]) > gap else 0.0  # the flank that is, not one a step away
                out[:, k] = 0.0
                out[k - 2, k] = -slope / J
                out[7, k] = i_m * slope / J_m
                continue
            at[k] = y[k] + 1.0
            rates(t, at, rate)
            at[k] = y[k]
            for row in range(STATES):
                out[row, k] = rate[row] - base[row]

    @njit
    def rates_new(t, y):  # type: ignore[no-untyped-def]
        out = np.empty(STATES)
        rates(t, y, out)
        return out

    y, out = np.zeros(STATES), np.empty(STATES)
    rates(0.0, y, out), rates_new(0.0, y), jacobian(0.0, y, np.empty((STATES, STATES)))
    return rates, jacobian, rates_new


def sizes() -> Array:
    """What absolute tolerances are relative to: usual sizes of the states."""
    m = machine()
    twist = m.drives[0].gap + 4000 / m.drives[0].K_t
    return np.array([0.9, 0.9, twist, twist, 350, 350, 0.02, 0.063, 0.1, 0.1, 200])


def eq_23(y: Array) -> Array:
    """Shape (times, 11) to the order of Eq. 23, absolute pinion angles."""
    i_m, X = machine().i_m, y[:, :8].copy()
    X[:, 2] += i_m * y[:, 6]
    X[:, 3] += i_m * y[:, 6]
    return X


def scipy_engines(slow: bool) -> list[Engine]:
    from scipy.integrate import solve_ivp

    _, jacobian, f = compiled()
    gap = machine().drives[0].gap

    def side(state: int, sign: float) -> Any:
        def event(t: float, y: Array) -> float:
            return float(y[state]) + sign * gap

        return event

    events = [side(state, sign) for state in (2, 3) for sign in (-1.0, 1.0)]

    def J(t: float, y: Array) -> Array:
        out = np.empty((STATES, STATES))
        jacobian(t, y, out)
        return out

    def run(method: str, rtol: float) -> tuple[Array, int]:
        options: Any = {"jac": J} if method in ("Radau", "BDF") else {}
        found = solve_ivp(  # type: ignore[call-overload]  # method is a plain text
            f, (0.0, SPAN), np.zeros(STATES), method, t_eval=grid(), events=events, rtol=rtol,
            atol=rtol * sizes(), **options,
        )  # fmt: skip
        if not found.success:
            raise RuntimeError(found.message)
        return eq_23(found.y.T), sum(map(len, found.t_events))

    def engine(method: str, *rtols: float) -> Engine:
        return Engine(f"SciPy {method}", rtols, lambda rtol: run(method, rtol), repeats=2)

    quick = [
        engine("LSODA", 1e-6, 1e-8, 1e-10, 1e-12),
        engine("DOP853", 1e-6, 1e-8, 1e-10, 1e-12),
    ]
    return [*quick, engine("Radau", 1e-5, 1e-7), engine("BDF", 1e-6, 1e-8)] if slow else quick


def sundae_engines() -> list[Engine]:
    from sksundae.cvode import CVODE

    f, jacobian, _ = compiled()
    gap = machine().drives[0].gap

    def rates(t: float, y: Array, yp: Array) -> None:
        f(t, y, yp)

    def J(t: float, y: Array, yp: Array, out: Array) -> None:
        jacobian(t, y, out)

    def events(t: float, y: Array, out: Array) -> None:
        x_1, x_2 = y[2], y[3]
        out[0], out[1], out[2], out[3] = x_1 - gap, x_1 + gap, x_2 - gap, x_2 + gap

    events.terminal = [False] * 4  # type: ignore[attr-defined]
    events.direction = [0] * 4  # type: ignore[attr-defined]

    def run(method: str, rtol: float) -> tuple[Array, int]:
        solver = CVODE(
            rates, method=method, rtol=rtol, atol=rtol * sizes(), jacfn=J, eventsfn=events,
            num_events=4, max_num_steps=1_000_000,
        )  # fmt: skip
        found = solver.solve(grid(), np.zeros(STATES))
        if not found.success:
            raise RuntimeError(str(found.message))
        times = found.t
        y = found.y
        if len(times) != len(grid()):  # located events stand between the output times
            y = y[np.isin(times, grid())]
        contacts = 0 if found.t_events is None else len(found.t_events)
        return eq_23(np.asarray(y)), contacts

    def engine(method: str, *rtols: float) -> Engine:
        return Engine(
            f"scikit-sundae CVODE {method}", rtols, lambda rtol: run(method, rtol), repeats=2
        )

    return [engine("Adams", 1e-6, 1e-8, 1e-10, 1e-12), engine("BDF", 1e-6, 1e-8, 1e-10)]
