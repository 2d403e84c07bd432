"""The exponential engine: the linear part of a machine exact, laws that are not affine beside it.

Machines with such laws under CVODE's eyes: test_engine_explicit.py; φ-functions and nodes:
tests/cpp/test_exponential.cpp; who of several engines has a run: test_engine_auto.py.
"""

from __future__ import annotations

import numpy as np
import pytest

import usual_laws
from core_machines import Run, core_inputs, core_machine, run, set_all
from core_random import RandomMachine
from dualdrive import _core
from reference_model import bench, sine

#: bristles are stiff: not for this engine
LAWS = {law: own for law, own in usual_laws.LAWS.items() if law != "lugre"}
SIGNALS = ["omega_c1", "omega_c2", "mesh_1.twist", "mesh_2.twist", "I_1", "I_2", "theta_m",
           "omega_m"]  # fmt: skip
Switch = tuple[str, str, str]


def bench_with(law: str = "") -> _core.Machine:
    machine = core_machine(bench().control(omega_ci=2500.0))
    machine.set("motors.T_rated", 1.27)
    places, values = LAWS.get(law, ((), {}))
    for place in places:
        set_all(machine, machine.add_effect(law, place), values)
    return machine


def seen(law: str, engine: str, rtol: float, end: float = 1.6, **options: object) -> Run:
    return run(bench_with(law), core_inputs(sine(0.3, 0.5)), end, rtol=rtol, engine=engine,
               signals=SIGNALS, **options)  # type: ignore[arg-type]  # fmt: skip


def off(a: Run, b: Run) -> float:
    """The worst state's largest difference, over its own peak."""
    true, found = np.asarray(b.raw.values), np.asarray(a.raw.values)
    return float((np.abs(found - true).max(axis=0) / np.abs(true).max(axis=0)).max())


def order(r: Run) -> list[Switch]:
    return [event[1:] for event in r.raw.events]


def test_a_machine_that_is_affine_is_solved_as_the_exact_engine_solves_it() -> None:
    exact, forced = seen("", "exact", 1e-10), seen("", "exponential", 1e-10)
    assert forced.raw.statistics["method"] == "exponential"
    assert order(forced) == order(exact)
    times = [[event[0] for event in r.raw.events] for r in (forced, exact)]
    np.testing.assert_allclose(times[0], times[1], rtol=0, atol=1e-12)
    assert off(forced, exact) < 1e-11
    assert forced.raw.statistics["steps"] < 100


@pytest.mark.parametrize("law", LAWS)
def test_every_law_moves_as_the_explicit_engine_says(law: str) -> None:
    truth = seen(law, "explicit", 1e-12)
    for rtol in (1e-6, 1e-9):
        found = seen(law, "exponential", rtol)
        assert off(found, truth) < 10 * rtol
        assert order(found) == order(truth)
        assert found.raw.statistics["energy_error"] < 100 * rtol


def test_the_error_falls_with_a_high_power_of_the_work() -> None:
    """Of order nine, four decades of the tolerance shorten steps to 10^(-4/9)."""
    truth = seen("torque_ripple", "explicit", 1e-13)
    coarse, fine = (seen("torque_ripple", "exponential", rtol) for rtol in (1e-6, 1e-10))
    assert off(fine, truth) < 1e-3 * off(coarse, truth)
    assert fine.raw.statistics["rhs"] < 10 ** (4 / 7) * coarse.raw.statistics["rhs"]


def test_fast_poles_cost_nothing() -> None:
    """Current loops ten times as fast: the explicit engine takes ten times as many steps."""
    machine = core_machine(bench().control(omega_ci=25000.0))
    set_all(machine, machine.add_effect("unbalance", "table"), {"amplitude": 0.1})
    slow = seen("unbalance", "exponential", 1e-8)
    fast = run(machine, core_inputs(sine(0.3, 0.5)), 1.6, rtol=1e-8, engine="exponential")
    assert fast.raw.statistics["rhs"] < 2 * slow.raw.statistics["rhs"]


def test_outputs_change_neither_steps_much_nor_the_solution() -> None:
    dense = seen("torque_ripple", "exponential", 1e-9, output_step=1e-3)
    sparse = seen("torque_ripple", "exponential", 1e-9, output_step=0.4)
    assert sparse.raw.statistics["rhs"] < 2 * dense.raw.statistics["rhs"]
    np.testing.assert_allclose(sparse["omega_m"], dense["omega_m"][::400], rtol=0, atol=1e-8)
    assert order(sparse) == order(dense)


def test_between_the_points_of_a_step_the_solution_is_as_good() -> None:
    times = [float(t) for t in np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 200))]
    truth, found = (seen("wear", engine, rtol, 1.0, times=times)
                    for engine, rtol in (("explicit", 1e-12), ("exponential", 1e-10)))  # fmt: skip
    assert off(found, truth) < 1e-9


def test_a_law_that_is_steep_where_a_body_turns_back_is_seen() -> None:
    """Friction falls within 2 mrad/s of standing still, far less than a step of the motion."""
    machine = core_machine(bench())
    set_all(machine, machine.add_effect("stribeck", "table"),
            {"torque": 0.1, "static_ratio": 1.5, "speed": 2e-3})  # fmt: skip
    truth, found = (run(machine, core_inputs(sine(0.3, 0.5)), 1.6, rtol=rtol, engine=engine,
                        signals=SIGNALS)
                    for engine, rtol in (("explicit", 1e-12), ("exponential", 1e-7)))  # fmt: skip
    assert order(found) == order(truth)
    assert off(found, truth) < 1e-6


def test_a_fall_that_begins_within_rounding_is_followed_to_its_end() -> None:
    """A speed loop whose output stays at its limit: the guard leaves zero with the square of time,
    by less than rounding in the first stretch of a step and by more in the next."""
    m = RandomMachine(1616)
    truth, found = (run(m.machine, m.inputs, 1.5, initial=m.initial, rtol=rtol, engine=engine,
                        signals=["theta_m"])
                    for engine, rtol in (("explicit", 1e-11), ("exponential", 1e-9)))  # fmt: skip
    times = [[event[0] for event in r.events("controller.speed_2")] for r in (found, truth)]
    assert len(times[0]) == len(times[1])
    np.testing.assert_allclose(times[0], times[1], rtol=0, atol=1e-6)


def test_a_step_that_ends_a_rounding_beyond_its_last_node_ends() -> None:
    """A stop within 1e-12 s of the last of nine nodes is taken for it."""
    m = RandomMachine(4548)
    found = run(m.machine, m.inputs, 0.3, initial=m.initial, rtol=1e-9, engine="exponential",
                signals=["theta_m"])  # fmt: skip
    assert found.t[-1] == 0.3


def test_a_recorded_command_changes_its_form_within_steps() -> None:
    """Knots of a smooth command at 7 ms, of which nothing else is a multiple."""
    knots = np.arange(0.0, 1.6, 7e-3)
    command = {
        "theta_ref": _core.sampled(knots, 0.3 * np.sin(np.pi * knots), _core.Interpolation.cubic)
    }
    machine = bench_with("unbalance")
    truth, found = (run(machine, command, 1.5, rtol=rtol, engine=engine, signals=SIGNALS)
                    for engine, rtol in (("explicit", 1e-12), ("exponential", 1e-9)))  # fmt: skip
    assert off(found, truth) < 1e-8
    assert order(found) == order(truth)


def test_the_same_run_gives_the_same_bits() -> None:
    first, second = (seen("hertzian_stiffness", "exponential", 1e-8) for _ in range(2))
    assert np.asarray(first.raw.values).tobytes() == np.asarray(second.raw.values).tobytes()
    assert first.raw.events == second.raw.events
    assert first.raw.statistics == second.raw.statistics


def test_a_method_of_another_engine_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="method is of the cvode engine alone"):
        seen("unbalance", "exponential", 1e-8, method="bdf")
