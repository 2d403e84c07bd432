"""The case's equations for other people's solvers, compiled by Numba.

In the coordinates that dualdrive integrates (twists of the meshes, not absolute angles). The field
is affine while the flanks stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import cos, pi, sin
from typing import Any, NamedTuple

import numpy as np

from case import AMPLITUDE, FREQUENCY, Array, machine

# omega_c1, omega_c2, x_1, x_2, I_1, I_2, theta_m, omega_m, two speed integrals, equaliser integral
STATES = 11
TWISTS = (2, 3)


class Problem(NamedTuple):
    """What switches, for solvers that freeze modes: compiled functions, `out` is written into.

    A run starts at rest, in modes 0.
    """

    states: int
    modes: int
    guards: int
    rates: Any  # (t, y, modes, out)
    margins: Any  # (t, y, modes, out): the guards, positive while the modes stay
    change: Any  # (guard, t, y, modes): the mode after that guard; may correct y


def constants() -> tuple[float, ...]:
    """The numbers in the order of Machine in plain_cvode/machine.hpp."""
    m = machine()
    drive, law = m.drives[0], m.controller
    assert law is not None
    return (
        drive.J, drive.b, drive.K_m, drive.K_e, drive.R, drive.L, drive.K_t, drive.gap, m.i_m,
        m.J_m, m.b_m, law.K_v, law.f_v, law.k_p, law.k_p / law.T_N, law.K_E, law.K_E / law.T_E,
        law.T_ten, AMPLITUDE, 2 * pi * FREQUENCY,
    )  # fmt: skip


def law() -> Callable[..., tuple[Any, ...]]:
    """The rates as a function of state, command, its rate and the meshes' torques.

    For numbers, for symbols, and for Numba to compile.
    """
    (J, b, K_m, K_e, R, L, _, _, i_m, J_m, b_m, K_v, f_v, k_p, k_i, K_E, k_E, T_ten,
     _, _) = constants()  # fmt: skip

    def rates(y, command, speed, T_1, T_2):  # type: ignore[no-untyped-def]
        Omega_1 = i_m * (K_v * (command - y[6]) + f_v * speed)
        e_T = K_m * (y[4] - y[5]) - T_ten
        e_1 = Omega_1 - y[0]
        e_2 = Omega_1 + K_E * e_T + k_E * y[10] - y[1]
        return (
            (K_m * y[4] - b * y[0] - T_1) / J,
            (K_m * y[5] - b * y[1] - T_2) / J,
            y[0] - i_m * y[7],
            y[1] - i_m * y[7],
            (k_p * e_1 + k_i * y[8] - R * y[4] - K_e * y[0]) / L,
            (k_p * e_2 + k_i * y[9] - R * y[5] - K_e * y[1]) / L,
            y[7],
            (i_m * (T_1 + T_2) - b_m * y[7]) / J_m,
            e_1,
            e_2,
            e_T,
        )

    return rates


class Compiled(NamedTuple):
    """Functions that write into their last argument."""

    rates: Any  # (t, y, out), flanks from the twists
    jacobian: Any  # (t, y, out), as `rates`
    frozen: Any  # (t, y, flanks, out): -1 back, 0 in the gap, 1 front, for each mesh


@cache
def compiled() -> Compiled:
    from numba import njit

    rates_at = njit(law())
    numbers = constants()
    J, K_t, gap, i_m, J_m, size, turn = (numbers[k] for k in (0, 6, 7, 8, 9, 18, 19))

    @njit
    def flank(x):  # type: ignore[no-untyped-def]
        return 1 if x > gap else (-1 if x < -gap else 0)

    @njit
    def mesh(x, side):  # type: ignore[no-untyped-def]  # torque, Eq. 15-17 corrected
        return K_t * (x - side * gap) if side != 0 else 0.0

    @njit
    def put(t, y, side_1, side_2, out):  # type: ignore[no-untyped-def]
        T_1, T_2 = mesh(y[2], side_1), mesh(y[3], side_2)
        found = rates_at(y, size * sin(turn * t), size * turn * cos(turn * t), T_1, T_2)
        for k in range(STATES):
            out[k] = found[k]

    @njit
    def rates(t, y, out):  # type: ignore[no-untyped-def]
        put(t, y, flank(y[2]), flank(y[3]), out)

    @njit
    def frozen(t, y, flanks, out):  # type: ignore[no-untyped-def]
        put(t, y, flanks[0], flanks[1], out)

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

    y, out = np.zeros(STATES), np.empty(STATES)  # once now, so that no run waits for the compiler
    rates(0.0, y, out), jacobian(0.0, y, np.empty((STATES, STATES)))
    return Compiled(rates, jacobian, frozen)


@cache
def problem() -> Problem:
    """The case with its flanks as modes, two guards to each mesh."""
    from numba import njit

    gap = machine().drives[0].gap

    @njit
    def margins(t, y, flanks, out):  # type: ignore[no-untyped-def]
        for m in range(2):
            side, x = flanks[m], y[TWISTS[m]]
            out[2 * m] = side * x - gap if side != 0 else gap - x
            out[2 * m + 1] = 1.0 if side != 0 else x + gap

    @njit
    def change(guard, t, y, flanks):  # type: ignore[no-untyped-def]
        m = guard // 2
        flanks[m] = 0 if flanks[m] != 0 else (1 if guard % 2 == 0 else -1)

    return Problem(STATES, 2, 4, compiled().frozen, margins, change)


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
