"""The explicit Runge-Kutta method of order 8 in Numba, of a problem whose modes are frozen.

Coefficients and step control of Hairer, Norsett and Wanner's DOP853, taken from SciPy. Guards that
might come to zero within a step are looked at, and located, on its dense output; the next step
starts there, in the next mode.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from case import Array, grid
from equations import Problem, eq_23, problem, sizes
from measure import RTOLS, Engine

NAME = "DOP853 in Numba, flanks frozen"
LOOKS = 8  # at the guards within a step, on the dense output
AHEAD = 1e-3  # of a step: over which a guard's slope is told
SHORTEST = 1e-15  # s; a step of less, or so many switches, is no headway
MOST_SWITCHES = 20_000
LOCATED = 1e-13  # of a step: how closely a mode's end is told


def integrator(problem: Problem) -> Any:
    """Compile (rtol, atol, times) -> (states at the times, switches, evaluations of the rates).

    The run starts at the first of the times, at rest, in modes 0. Shapes: atol (states,), states
    (times, states). Raises RuntimeError where there is no headway.
    """
    from numba import njit
    from scipy.integrate._ivp import dop853_coefficients as table

    A, B, C, D = (np.ascontiguousarray(getattr(table, name)) for name in "ABCD")
    E3, E5 = table.E3[:13].copy(), table.E5[:13].copy()
    STATES, MODES, GUARDS, f, margins, change = problem  # constants to the compiler

    @njit
    def combine(K, weights, n, scale, out):  # type: ignore[no-untyped-def]  # adds to `out`
        for j in range(n):
            w = scale * weights[j]
            if w != 0.0:
                for k in range(STATES):
                    out[k] += w * K[j, k]

    @njit
    def stages(t, h, y, modes, K, first, last, at):  # type: ignore[no-untyped-def]
        for s in range(first, last):
            at[:] = y
            combine(K, A[s], s, h, at)
            f(t + C[s] * h, at, modes, K[s])

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
    def dense(t, h, y, y_new, modes, K, F, at):  # type: ignore[no-untyped-def]
        stages(t, h, y, modes, K, 13, 16, at)
        F[:] = 0.0
        for k in range(STATES):
            delta = y_new[k] - y[k]
            F[0, k] = delta
            F[1, k] = h * K[0, k] - delta
            F[2, k] = 2 * delta - h * (K[12, k] + K[0, k])
        for row in range(4):
            combine(K, D[row], 16, h, F[3 + row])

    @njit
    def inside(y, F, x, out):  # type: ignore[no-untyped-def]  # the state at a share of the step
        for k in range(STATES):
            value = 0.0
            for i in range(6, -1, -1):
                value = (value + F[i, k]) * (x if i % 2 == 0 else 1 - x)
            out[k] = y[k] + value

    @njit
    def slopes(t, y, rate, ahead, modes, g, at, out):  # type: ignore[no-untyped-def]
        for k in range(STATES):
            at[k] = y[k] + ahead * rate[k]
        margins(t + ahead, at, modes, out)
        for k in range(GUARDS):
            out[k] = (out[k] - g[k]) / ahead

    @njit
    def cannot_fall(g0, g1, s0, s1):  # type: ignore[no-untyped-def]
        # the cubic through both ends lies above its lowest Bernstein coefficient
        return min(g0, g1, g0 + s0 / 3, g1 - s1 / 3) > 0

    @njit
    def quiet(t, h, y, y_new, K, modes, G, at):  # type: ignore[no-untyped-def]
        margins(t, y, modes, G[0])
        margins(t + h, y_new, modes, G[1])
        slopes(t, y, K[0], AHEAD * h, modes, G[0], at, G[2])
        slopes(t + h, y_new, K[12], -AHEAD * h, modes, G[1], at, G[3])
        for k in range(GUARDS):  # noqa: SIM110  # Numba compiles no all()
            if not cannot_fall(G[0, k], G[1, k], h * G[2, k], h * G[3, k]):
                return False
        return True

    @njit
    def first_end(t, h, y, F, modes, g, at):  # type: ignore[no-untyped-def]
        """Return where in the step a mode ends first, and which; 2.0 for nowhere.

        The first of the looks with a guard below zero, then the Illinois method on the least guard.
        """
        above, v_above, under, v_under = 0.0, 0.0, 0.0, 0.0
        for look in range(1, LOOKS + 1):
            under = look / LOOKS
            inside(y, F, under, at)
            margins(t + under * h, at, modes, g)
            v_under = g.min()
            if v_under < 0:
                break
            above, v_above = under, v_under
        else:
            return 2.0, -1
        side = 0
        while under - above > LOCATED:
            middle = (above + under) / 2
            # a guard that the step begins on may be a rounding below zero there
            place = (
                above + (under - above) * v_above / (v_above - v_under) if v_above > 0 else middle
            )
            if not above < place < under:
                place = middle
            inside(y, F, place, at)
            margins(t + place * h, at, modes, g)
            value = g.min()
            if value < 0:
                under, v_under = place, value
                v_above *= 0.5 if side < 0 else 1.0
                side = -1
            else:
                above, v_above = place, value
                v_under *= 0.5 if side > 0 else 1.0
                side = 1
        inside(y, F, under, at)
        margins(t + under * h, at, modes, g)
        return under, g.argmin()

    @njit
    def run(rtol, atol, times):  # type: ignore[no-untyped-def]
        found, last = np.zeros((len(times), STATES)), times[-1]
        y, K, F = np.zeros(STATES), np.zeros((16, STATES)), np.zeros((7, STATES))
        y_new, at, scratch = np.zeros(STATES), np.zeros(STATES), np.zeros((2, STATES))
        modes, G = np.zeros(MODES, np.int64), np.zeros((4, GUARDS))
        t, h, row, switches, rejected = times[0], 1e-6, 1, 0, False
        f(t, y, modes, K[0])
        evaluations = 1
        while row < len(times):
            h = min(h, last - t)
            stages(t, h, y, modes, K, 1, 12, at)
            y_new[:] = y
            combine(K, B, 12, h, y_new)
            f(t + h, y_new, modes, K[12])
            evaluations += 12
            error = error_norm(K, h, y, y_new, rtol, atol, scratch)
            if not error < 1:
                h *= max(0.2, 0.9 * error ** (-1 / 8))
                rejected = True
                if not h > SHORTEST:
                    raise RuntimeError("the step size fell to nothing")
                continue
            done, which, t_new = 1.0, -1, t + h
            calm = quiet(t, h, y, y_new, K, modes, G, at)
            if not calm or times[row] <= t_new:
                dense(t, h, y, y_new, modes, K, F, at)
                evaluations += 3
            if not calm:
                place, which = first_end(t, h, y, F, modes, G[0], at)
                if which >= 0:
                    done, t_new = place, t + place * h
            while row < len(times) and times[row] <= t_new:
                inside(y, F, (times[row] - t) / h, found[row])
                row += 1
            if which >= 0:
                inside(y, F, done, y_new)
                change(which, t_new, y_new, modes)
                switches += 1
                if switches > MOST_SWITCHES:
                    raise RuntimeError("it chatters")
            else:
                grow = 10.0 if error == 0 else min(10.0, 0.9 * error ** (-1 / 8))
                h *= min(1.0, grow) if rejected else max(0.2, grow)
            t, rejected = t_new, False
            y[:] = y_new
            K[0] = K[12]  # of the same state, unless its modes have changed
            if which >= 0:
                f(t, y, modes, K[0])
                evaluations += 1
        return found, switches, evaluations

    return run


def engines() -> list[Engine]:
    do = integrator(problem())

    def run(rtol: float) -> tuple[Array, int]:
        y, contacts, _ = do(rtol, rtol * sizes(), grid())
        return eq_23(y), contacts

    run(1e-3)
    return [Engine(NAME, RTOLS, run)]
