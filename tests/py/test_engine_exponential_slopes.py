"""Forward sensitivities of the exponential engine: against the explicit one's, the exact one's, and
differences of runs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from core_machines import Array, Run, core_inputs, core_machine, run, set_all
from core_random import RandomMachine
from dualdrive import _core
from reference_model import bench, sine
from test_engine_exponential import LAWS, SIGNALS, order

PARAMETERS = ["table.J", "mesh_1.stiffness", "mesh_2.gap", "motor_1.R", "motor_2.L",
              "controller.K_v", "controller.T_ten", "initial.omega_m", "initial.I_1"]  # fmt: skip
SINE = core_inputs(sine(0.3, 0.5))


def uneven(law: str = "", **control: float) -> _core.Machine:
    """Of two contacts at one instant no derivative by either exists: these come one by one."""
    machine = core_machine(bench().control(omega_ci=2500.0))
    set_all(machine, "controller", control)
    machine.set("motors.T_rated", 1.27)
    machine.set("mesh_2.gap", 1.1 * machine.get("mesh_2.gap"))
    places, values = LAWS.get(law, ((), {}))
    for place in places:
        set_all(machine, machine.add_effect(law, place), values)
    return machine


def slopes(
    machine: _core.Machine, engine: str, rtol: float, end: float = 1.2,
    parameters: list[str] = PARAMETERS, command: Mapping[str, _core.Waveform] = SINE,
    **options: object,
) -> Run:  # fmt: skip
    return run(machine, command, end, rtol=rtol, engine=engine, signals=SIGNALS,
               sensitivities=parameters, **options)  # type: ignore[arg-type]  # fmt: skip


def apart(
    found: Run, truth: Run, machine: _core.Machine, parameters: list[str] = PARAMETERS
) -> float:
    """The worst slope's largest difference, over its own peak or, where a parameter hardly matters,
    a millionth of what would move the signal by its own peak."""
    told, true = (np.asarray(r.raw.sensitivities) for r in (found, truth))
    assert told.shape == true.shape
    known = {p.path: abs(p.value) for p in machine.parameters()}
    size = np.array([known.get(path, 1.0) or 1.0 for path in parameters])
    least = 1e-6 * np.abs(np.asarray(truth.raw.values)).max(axis=0)[:, None] / size
    share: Array = np.abs(told - true).max(axis=0) / np.maximum(np.abs(true).max(axis=0), least)
    return float(share.max())


def first_of(machine: _core.Machine, law: str) -> str:
    """The path of a law's first number."""
    return next(p.path for p in machine.parameters() if p.path.startswith(f"{law}@"))


@pytest.mark.parametrize("law", LAWS)
def test_of_every_law_they_are_those_of_the_explicit_engine(law: str) -> None:
    machine = uneven(law)
    asked = [*PARAMETERS, first_of(machine, law)]
    truth = slopes(machine, "explicit", 1e-12, parameters=asked)
    for rtol in (1e-6, 1e-9):
        found = slopes(machine, "exponential", rtol, parameters=asked)
        assert found.raw.statistics["method"] == "exponential"
        assert order(found) == order(truth)
        assert apart(found, truth, machine, asked) < 200 * rtol


def test_where_all_is_affine_they_are_the_exact_engine_s() -> None:
    machine = uneven()
    exact, found = (slopes(machine, engine, 1e-10) for engine in ("exact", "exponential"))
    assert apart(found, exact, machine) < 1e-8
    assert found.raw.statistics["steps"] < 200


def test_a_law_of_size_nought_has_a_slope() -> None:
    """The run shows nothing of it: rows that it acts on are driven for its slope alone."""
    machine, step = uneven("torque_ripple"), 1e-4
    path = first_of(machine, "torque_ripple")
    machine.set(path, 0.0)
    found = slopes(machine, "exponential", 1e-9, parameters=[path])
    sides = []
    for side in (step, 0.0):
        machine.set(path, side)
        sides.append(np.asarray(slopes(machine, "explicit", 1e-12).raw.values))
    difference = (sides[0] - sides[1]) / step
    told = np.asarray(found.raw.sensitivities)[:, :, 0]
    np.testing.assert_allclose(told, difference, rtol=0, atol=0.02 * np.abs(difference).max())
    assert np.abs(told).max() > 0


@pytest.mark.parametrize("grid", [7e-3, 1e-3], ids=["between_outputs", "at_outputs"])
def test_knots_of_a_recorded_command_do_not_break_them(grid: float) -> None:
    at = np.arange(0.0, 1.4, grid)
    command = {"theta_ref": _core.sampled(at, 0.3 * np.sin(np.pi * at), _core.Interpolation.cubic)}
    machine = uneven("eccentricity")
    truth = slopes(machine, "explicit", 1e-12, command=command)
    found = slopes(machine, "exponential", 1e-9, command=command)
    assert apart(found, truth, machine) < 1e-6


def test_between_the_points_of_a_step_they_are_as_good() -> None:
    times = [float(t) for t in np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 200))]
    machine = uneven("wear")
    truth, found = (slopes(machine, engine, rtol, 1.0, times=times)
                    for engine, rtol in (("explicit", 1e-12), ("exponential", 1e-10)))  # fmt: skip
    assert apart(found, truth, machine) < 1e-7


def test_what_comes_back_late_is_followed() -> None:
    """Between the drives: the past has slopes, too, and by the delay's own length."""
    machine = uneven("hydrostatic_drag", delta_t=0.05)
    asked = ["table.J", "controller.delta_t", "initial.omega_m"]
    truth = slopes(machine, "explicit", 1e-11, parameters=asked)
    found = slopes(machine, "exponential", 1e-9, parameters=asked)
    assert apart(found, truth, machine, asked) < 1e-6


@pytest.mark.parametrize(("seed", "name"), [(285, "controller.delta_c"), (71, "controller.f_v")])
def test_what_jumps_a_delay_later_jumps_at_the_end_of_a_step(seed: int, name: str) -> None:
    """A step that ends within 1e-12 s before it has left the jump to the next step, as a crossing
    of a limiter's own: slopes were off by seven times their size, the states by nothing."""
    m = RandomMachine(seed)
    truth, found = (slopes(m.machine, engine, rtol, 0.45, [name], m.inputs, initial=m.initial)
                    for engine, rtol in (("explicit", 1e-11), ("exponential", 1e-8)))  # fmt: skip
    assert order(found) == order(truth)
    assert apart(found, truth, m.machine, [name]) < 1e-5


def test_sampled_loops_carry_them_from_tick_to_tick() -> None:
    machine = uneven("eccentricity", speed_sample=1e-3)
    truth = slopes(machine, "explicit", 1e-11)
    found = slopes(machine, "exponential", 1e-9)
    assert apart(found, truth, machine) < 1e-6


def test_signals_that_are_not_linear_have_them_as_well() -> None:
    """An acceleration under a law, by the model; the others by rows of the tangent."""
    machine, asked = uneven("torque_ripple"), ["table.J", "mesh_1.stiffness"]
    truth, found = (run(machine, SINE, 0.8, rtol=rtol, engine=engine, sensitivities=asked,
                        signals=["alpha_m", "theta_m"])
                    for engine, rtol in (("explicit", 1e-12), ("exponential", 1e-9)))  # fmt: skip
    assert apart(found, truth, machine, asked) < 1e-6


def test_auto_takes_them_from_this_engine() -> None:
    found = slopes(uneven("unbalance"), "auto", 1e-6)
    assert found.raw.statistics["method"] == "exponential"


def test_the_same_run_gives_the_same_bits() -> None:
    first, second = (slopes(uneven("cogging"), "exponential", 1e-8) for _ in range(2))
    told = [np.asarray(r.raw.sensitivities).tobytes() for r in (first, second)]
    assert told[0] == told[1]
