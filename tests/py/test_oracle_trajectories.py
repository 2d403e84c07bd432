"""Oracle 5: trajectories and every contact against the mode-wise exact solution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core_machines import apart, nearest_times, run_like
from reference_model import (
    Machine,
    Motion,
    Trajectory,
    bench,
    heavy_table,
    load_ramp,
    move,
    simulate,
    sine,
    speed_study,
    step,
)

pytestmark = pytest.mark.usefixtures("both_engines")

Case = tuple[Machine, Motion, float]


def impacts(variant: str) -> Case:
    return speed_study(variant), sine(0.02, 0.5), 10.0


def hunting(load: int) -> Case:
    machine = heavy_table(load).control(T_ten=0.0)
    return machine, move(0.02, 0.03, 0.01, 0.05, start=2.0), 14.0


@cache
def truth(case: Callable[[str | int], Case], argument: str | int) -> Trajectory:
    return simulate(*case(argument))


@cache
def spread(case: Callable[[str | int], Case], argument: str | int) -> float:
    """Return how far the states move when one parameter is off by 1e-12 of itself."""
    (machine, motion, end), exact = case(argument), truth(case, argument)
    drive, off = machine.drives[0], 1 + 1e-12
    nudged = [machine.both(K_t=drive.K_t * off), replace(machine, J_m=machine.J_m * off)]
    peak = np.abs(exact.X).max(axis=0)
    return max(
        float((np.abs(simulate(other, motion, end).X - exact.X).max(axis=0) / peak).max())
        for other in nudged
    )


# ------------------------------------------------------------------------------------- impacts


@pytest.mark.parametrize(
    ("variant", "contacts", "states", "times"),
    [("S", 44, 2e-8, 2e-9), ("M", 85, 1e-7, 5e-8), ("H", 543, 1e-6, 2e-7), ("X", 1113, 1e-4, 1e-6)],
)
def test_every_contact_of_the_speed_study_at_the_default_tolerance(
    variant: str, contacts: int, states: float, times: float
) -> None:
    exact = truth(impacts, variant)
    run = run_like(*impacts(variant))
    assert len(exact.contacts) == contacts
    assert nearest_times(run, exact) < times
    assert apart(run, exact) < states


@pytest.mark.parametrize("method", ["adams", "bdf"])
def test_error_falls_with_the_tolerance(method: str) -> None:
    exact = truth(impacts, "S")
    errors = [
        apart(run_like(*impacts("S"), rtol=10.0**-k, method=method), exact) for k in (6, 8, 10)
    ]
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 10
    assert errors[2] < errors[1] / 10
    assert errors[2] < 1e-7


@pytest.mark.long
@pytest.mark.parametrize(("case", "argument"), [(impacts, "X"), (hunting, 550)])
def test_chaos_of_impacts_is_followed_as_far_as_numbers_go(
    case: Callable[[str | int], Case], argument: str | int
) -> None:
    """Within ten times what a parameter wrong in its twelfth digit does."""
    exact = truth(case, argument)
    run = run_like(*case(argument), rtol=2e-14)
    assert nearest_times(run, exact) < 1e-9
    assert apart(run, exact) < 10 * spread(case, argument)


@pytest.mark.long
@pytest.mark.parametrize("load", [250, 550])
def test_hunting_with_dry_friction_and_damping(load: int) -> None:
    exact = truth(hunting, load)
    run = run_like(*hunting(load))
    assert len(exact.contacts) > 90
    assert nearest_times(run, exact) < 1e-8
    assert apart(run, exact) < 2e-7


# ------------------------------------------------- limits, asymmetric friction, unequal drives


def saturated() -> Case:
    """All limits are met at once: speed, equaliser, torque and voltage; anti-windup rides."""
    machine = bench().both(T_max=0.25, U_max=14.0).control(Omega_max=6.0, Omega_E=0.05, K_i=20.0)
    return machine, step(0.4, at=0.2) + move(-0.3, 2, 20, 400, start=0.9, origin=0.4), 1.5


def torque_limited() -> Case:
    machine = heavy_table(550).both(T_max=100.0)
    return machine, move(0.04, 0.05, 0.03, 0.06, start=2.0), 8.0


def slave_alone() -> Case:
    machine = heavy_table(100, dry_friction=False)
    machine = machine.control(K_i=2.0, K_d=0.5, w=0.4, equalises=(0.0, 1.0))
    return machine, step(1e-3, at=1.0), 4.0


def master_alone() -> Case:
    machine = heavy_table(100, dry_friction=False)
    machine = machine.control(K_i=2.0, K_d=0.5, w=0.6, equalises=(-1.0, 0.0))
    return machine, step(1e-3, at=1.0) + load_ramp(1e4, start=2.0), 4.0


def asymmetric() -> Case:
    machine, motion, end = hunting(250)
    return replace(machine.both(friction=(200.0, 500.0)), friction=(3e3, 1e3)), motion, end


def unequal() -> Case:
    first, second = bench().drives
    second = replace(
        second, J_d=4e-5, K_t=150.0, gap=3e-3, c=0.0, friction=(0.02, 0.05), K_d=0.25, C_e=0.25,
        R=1.5,
    )  # fmt: skip
    machine = replace(bench(), drives=(first, second), friction=(0.1, 0.05))
    return machine, sine(0.1, 1.0), 4.0


@pytest.mark.long
@pytest.mark.parametrize(
    "case", [saturated, torque_limited, slave_alone, master_alone, asymmetric, unequal]
)
def test_limits_and_friction_follow_the_exact_solution(case: Callable[[], Case]) -> None:
    machine, motion, end = case()
    exact = simulate(machine, motion, end)
    run = run_like(machine, motion, end)
    assert nearest_times(run, exact) < 1e-8
    assert apart(run, exact) < 3e-7
    assert apart(run_like(machine, motion, end, rtol=1e-12), exact) < 5e-9


def test_each_limit_switches_when_the_exact_solution_does() -> None:
    names = {"following": "controller.position", "equaliser": "controller.equaliser_2"}
    names |= {
        f"{loop}_{n}": f"controller.{loop}_{n}" for loop in ("speed", "current") for n in "12"
    }
    modes = {"free": "linear", "high held": "high", "low held": "low",
             "high slides": "riding high", "low slides": "riding low",
             "high returns": "high, unwinding", "low returns": "low, unwinding"}  # fmt: skip
    machine, motion, end = saturated()
    expected = [
        (e.t, names[e.element], modes[e.before], modes[e.after])
        for e in simulate(machine, motion, end).events
        if e.element in names
    ]
    run = run_like(machine, motion, end, rtol=1e-12)
    seen = [event for event in run.raw.events if event[1] in names.values()]
    assert any("riding" in event[3] for event in seen)
    assert {event[1] for event in seen} == set(names.values())
    assert sorted(e[1:] for e in seen) == sorted(e[1:] for e in expected)
    np.testing.assert_allclose([e[0] for e in seen], [e[0] for e in expected], atol=1e-8)
