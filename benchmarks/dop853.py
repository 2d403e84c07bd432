"""The case in an explicit Runge-Kutta method of order 8 that knows it: Numba, flanks frozen.

Coefficients and step control of Hairer, Norsett and Wanner's DOP853, taken from SciPy. Contacts are
located on the dense output of the step; the next step starts there, with the flank changed.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from case import SPAN, Array, grid, machine
from equations import STATES, TWISTS, compiled, eq_23, sizes
from measure import RTOLS, Engine

NAME = "DOP853 in Numba, flanks frozen"
LOOKS = 8  # at each twist within a step, on the dense output


@cache
def integrator() -> Any:
    """(rtol, atol, times) -> (states at the times, contacts)."""
    from numba import njit
    from scipy.integrate._ivp import dop853_coefficients as table

    A, B, C, D = (np.ascontiguousarray(getattr(table, name)) for name in "ABCD")
    E3, E5 = table.E3[:13].copy(), table.E5[:13].copy()
    f, gap, last = compiled().frozen, machine().drives[0].gap, SPAN

    @njit
    def combine(K, weights, n, scale, out):  # type: ignore[no-untyped-def]  # adds to `out`
        for j in range(n):
            w = scale * weights[j]
            if w != 0.0:
                for k in range(STATES):
                    out[k] += w * K[j, k]

    @njit
    def stages(t, h, y, flanks, K, first, last, at):  # type: ignore[no-untyped-def]
        for s in range(first, last):
            at[:] = y
            combine(K, A[s], s, h, at)
            f(t + C[s] * h, at, flanks, K[s])

    @njit
    def error_norm(K, h, y, y_new, rtol, atol, scratch):  # type: ignore[no-untyped-def]
        scratch[:] = 0.0
        combine(K, E5, 13, 1.0, scratch[0])
        combine(K, E3, 13, 1.0, scratch[1])
        fifth, third = 0.0, 0.0
        for k in range(STATES):
            scale = atol[k] + rtol * max(abs(y[k]), abs(y_new[k]))
            fifth += (scratch[0, k] / scale) ** 2
            third += (scratch[1, k] / scale) ** 2
        both = fifth + 0.01 * third
        return h * fifth / np.sqrt(both * STATES) if both > 0 else 0.0

    @njit
    def dense(t, h, y, y_new, flanks, K, F, at):  # type: ignore[no-untyped-def]
        stages(t, h, y, flanks, K, 13, 16, at)
        F[:] = 0.0
        for k in range(STATES):
            delta = y_new[k] - y[k]
            F[0, k] = delta
            F[1, k] = h * K[0, k] - delta
            F[2, k] = 2 * delta - h * (K[12, k] + K[0, k])
        for row in range(4):
            combine(K, D[row], 16, h, F[3 + row])

    @njit
    def inside(y, F, x, k):  # type: ignore[no-untyped-def]
        value = 0.0
        for i in range(6, -1, -1):
            value = (value + F[i, k]) * (x if i % 2 == 0 else 1 - x)
        return y[k] + value

    @njit
    def guard(twist, side):  # type: ignore[no-untyped-def]  # positive while the flank stays
        return side * twist - gap if side != 0 else gap - abs(twist)

    @njit
    def cannot_fall(g0, g1, s0, s1):  # type: ignore[no-untyped-def]
        # the cubic through both ends lies above its lowest Bernstein coefficient
        return min(g0, g1, g0 + s0 / 3, g1 - s1 / 3) > 0

    @njit
    def quiet(y, y_new, h, K, flanks):  # type: ignore[no-untyped-def]
        for m in range(2):
            x0, x1 = y[TWISTS[m]], y_new[TWISTS[m]]
            v0, v1 = h * K[0, TWISTS[m]], h * K[12, TWISTS[m]]
            sides = (flanks[m], flanks[m]) if flanks[m] != 0 else (1, -1)
            for side in sides:
                sign = side if flanks[m] != 0 else -side
                off = -gap if flanks[m] != 0 else gap
                if not cannot_fall(sign * x0 + off, sign * x1 + off, sign * v0, sign * v1):
                    return False
        return True

    @njit
    def first_contact(y, F, flanks):  # type: ignore[no-untyped-def]
        """Return where in the step a flank changes first, and which; 2.0 for nowhere."""
        best, which = 2.0, -1
        for m in range(2):
            above = 0.0
            for look in range(1, LOOKS + 1):
                under = look / LOOKS
                if guard(inside(y, F, under, TWISTS[m]), flanks[m]) >= 0:
                    above = under
                    continue
                while True:
                    middle = (above + under) / 2
                    if middle in (above, under):
                        break
                    if guard(inside(y, F, middle, TWISTS[m]), flanks[m]) >= 0:
                        above = middle
                    else:
                        under = middle
                if under < best:
                    best, which = under, m
                break
        return best, which

    @njit
    def run(rtol, atol, times):  # type: ignore[no-untyped-def]
        found = np.zeros((len(times), STATES))
        y, K, F = np.zeros(STATES), np.zeros((16, STATES)), np.zeros((7, STATES))
        y_new, at, scratch = np.zeros(STATES), np.zeros(STATES), np.zeros((2, STATES))
        flanks = np.zeros(2, np.int64)
        t, h, row, contacts, rejected = 0.0, 1e-6, 1, 0, False
        f(t, y, flanks, K[0])
        while row < len(times):
            h = min(h, last - t)
            stages(t, h, y, flanks, K, 1, 12, at)
            y_new[:] = y
            combine(K, B, 12, h, y_new)
            f(t + h, y_new, flanks, K[12])
            error = error_norm(K, h, y, y_new, rtol, atol, scratch)
            if not error < 1:
                h *= max(0.2, 0.9 * error ** (-1 / 8))
                rejected = True
                continue
            done, which, t_new = 1.0, -1, t + h
            calm = quiet(y, y_new, h, K, flanks)
            if not calm or times[row] <= t_new:
                dense(t, h, y, y_new, flanks, K, F, at)
            if not calm:
                place, which = first_contact(y, F, flanks)
                if which >= 0:
                    done, t_new = place, t + place * h
            while row < len(times) and times[row] <= t_new:
                for k in range(STATES):
                    found[row, k] = inside(y, F, (times[row] - t) / h, k)
                row += 1
            if which >= 0:
                for k in range(STATES):
                    y_new[k] = inside(y, F, done, k)
                side = 1 if y_new[TWISTS[which]] > 0 else -1
                flanks[which] = side if flanks[which] == 0 else 0
                contacts += 1
            else:
                grow = 10.0 if error == 0 else min(10.0, 0.9 * error ** (-1 / 8))
                h *= min(1.0, grow) if rejected else max(0.2, grow)
            t, rejected = t_new, False
            y[:] = y_new
            f(t, y, flanks, K[0])
        return found, contacts

    return run


def engines() -> list[Engine]:
    do = integrator()

    def run(rtol: float) -> tuple[Array, int]:
        y, contacts = do(rtol, rtol * sizes(), grid())
        return eq_23(y), contacts

    run(1e-3)
    return [Engine(NAME, RTOLS, run)]
