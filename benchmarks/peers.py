"""The case in other people's solvers, each written as well as its interface allows.

Compiled rates, the exact Jacobian where a method takes one, absolute tolerances scaled to each
state, and the contacts as events that are located but stop nothing. CasADi locates none.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from case import SPAN, Array, grid, machine
from equations import STATES, TWISTS, compiled, constants, eq_23, law, sizes
from measure import Engine

METHODS = {"adams": "Adams", "bdf": "BDF"}


def scipy_engines() -> list[Engine]:
    from numba import njit
    from scipy.integrate import solve_ivp

    jacobian, rates = compiled().jacobian, compiled().rates
    gap = machine().drives[0].gap

    @njit
    def f(t, y):  # type: ignore[no-untyped-def]
        out = np.empty(STATES)
        rates(t, y, out)
        return out

    f(0.0, np.zeros(STATES))

    def side(state: int, sign: float) -> Any:
        def event(t: float, y: Array) -> float:
            return float(y[state]) + sign * gap

        return event

    events = [side(state, sign) for state in TWISTS for sign in (-1.0, 1.0)]

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
        return Engine(f"SciPy {method}", rtols, lambda rtol: run(method, rtol))

    return [
        engine("LSODA", 1e-8, 1e-10, 1e-11, 1e-12),
        engine("DOP853", 1e-8, 1e-10, 1e-12, 1e-13),
        engine("Radau", 1e-5, 1e-7, 1e-9),
        engine("BDF", 1e-6, 1e-8),
    ]


def sundae_engines() -> list[Engine]:
    from sksundae.cvode import CVODE

    f, jacobian = compiled().rates, compiled().jacobian
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
        return Engine(f"scikit-sundae CVODE {method}", rtols, lambda rtol: run(method, rtol))

    return [engine("Adams", 1e-8, 1e-10, 1e-12, 1e-13), engine("BDF", 1e-8, 1e-10, 1e-12)]


def casadi_engines() -> list[Engine]:
    import casadi as ca

    numbers = constants()
    K_t, gap, size, turn = (numbers[k] for k in (6, 7, 18, 19))
    scaled, t = ca.SX.sym("scaled", STATES), ca.SX.sym("t")
    y = scaled * ca.DM(sizes())  # one absolute tolerance for all: states over their usual sizes

    def mesh(x: Any) -> Any:
        return ca.if_else(x > gap, K_t * (x - gap), ca.if_else(x < -gap, K_t * (x + gap), 0))

    command, speed = size * ca.sin(turn * t), size * turn * ca.cos(turn * t)
    rate = law()([y[k] for k in range(STATES)], command, speed, *(mesh(y[k]) for k in TWISTS))
    problem = {"x": scaled, "t": t, "ode": ca.vertcat(*rate) / ca.DM(sizes())}

    def engine(method: str, *rtols: float) -> Engine:
        ready = {
            rtol: ca.integrator("case", "cvodes", problem, 0.0, grid()[1:], {
                "reltol": rtol, "abstol": rtol, "linear_multistep_method": method,
                "max_num_steps": 1_000_000,
            })
            for rtol in rtols
        }  # fmt: skip

        def run(rtol: float) -> tuple[Array, int]:
            found = np.asarray(ready[rtol](x0=np.zeros(STATES))["xf"]).T
            return eq_23(np.vstack([np.zeros(STATES), found * sizes()])), 0

        return Engine(f"CasADi CVODES {METHODS[method]}", rtols, run)

    return [engine("adams", 1e-8, 1e-10, 1e-12), engine("bdf", 1e-8, 1e-10)]
