"""How runs end: every status, interrupts, and what the solver's settings may not change."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from core_machines import apart, core_inputs, core_machine, run_like
from dualdrive import _core
from patience import PATIENCE
from reference_model import bench, heavy_table, move, simulate, sine

TESTS = Path(__file__).parent
Switched = tuple[float, str, str, str]


def under(torque: str, **numbers: float) -> _core.Machine:
    """Return a free body under a formula."""
    machine = _core.Machine()
    machine.add_body("table")
    machine.set("table.J", 2.0)
    machine.add_expression("table", torque, [(name, "", v) for name, v in numbers.items()])
    return machine


def whole(result: _core.Trajectory) -> bool:
    """Say whether every array has all its rows and every number is one."""
    rows = len(result.t)
    return (
        result.values.shape == (rows, len(result.names))
        and result.modes.shape == (rows, len(result.elements))
        and result.work.shape == (rows, len(result.work_names))
        and bool(np.isfinite(result.values).all())
        and bool(np.isfinite(result.work).all())
    )


# ------------------------------------------------------------------------------ every status


def test_success_says_nothing() -> None:
    result = _core.simulate(under("-a * angle", a=8.0), {}, end=1.0, initial={"omega_m": 1.0})
    assert (result.status, result.message) == ("success", "")
    assert len(result.t) == 1001
    np.testing.assert_allclose(result.values[-1, result.names.index("theta_m")], np.sin(2.0) / 2)


@pytest.mark.parametrize("formula", ["sqrt(a - t)", "log(a - t)"])
def test_a_law_that_stops_being_a_number(formula: str) -> None:
    result = _core.simulate(under(formula, a=0.1), {}, end=1.0)
    assert result.status == "not_finite"
    assert "not finite" in result.message
    assert result.t[-1] == pytest.approx(0.1, abs=2e-3)
    assert whole(result)


@pytest.mark.parametrize("a", [0.1, 1 / 3, 0.123456])
def test_a_law_that_goes_to_infinity(a: float) -> None:
    """Which of the two depends on whether a step meets the pole itself."""
    result = _core.simulate(under("1 / (a - t)^2", a=a), {}, end=1.0)
    assert result.status in {"step_too_small", "not_finite"}
    assert result.t[-1] == pytest.approx(a, abs=2e-3)
    assert whole(result)


def test_a_law_that_is_no_number_at_once() -> None:
    result = _core.simulate(under("log(speed)"), {}, end=1.0)
    assert result.status == "not_finite"
    assert len(result.t) == 0
    assert whole(result)


@pytest.mark.parametrize("method", ["adams", "bdf"])
def test_a_motion_that_explodes_in_finite_time(method: str) -> None:
    """J ω̇ = a ω³ reaches infinity at t = J / (2 a ω0²) = 0.125 s."""
    result = _core.simulate(
        under("a * speed^3", a=2.0), {}, end=1.0, initial={"omega_m": 2.0}, method=method
    )
    assert result.status in {"step_too_small", "not_finite"}
    assert result.message.startswith(("at t = 0.125 s", "at t = 0.12499999"))
    assert result.t[-1] == 0.124
    assert whole(result)
    speed = result.values[:, result.names.index("omega_m")]
    np.testing.assert_allclose(speed, 2 / np.sqrt(1 - result.t / 0.125), rtol=1e-6)


def test_too_many_steps() -> None:
    spring = under("-a * angle", a=1e4)
    result = _core.simulate(spring, {}, end=1.0, initial={"omega_m": 2.0}, max_steps=20)
    assert result.status == "too_many_steps"
    assert "max_steps = 20" in result.message
    assert whole(result)
    complete = _core.simulate(spring, {}, end=1.0, initial={"omega_m": 2.0})
    np.testing.assert_array_equal(result.values, complete.values[: len(result.t)])


@pytest.mark.parametrize("engine", ["exact", "cvode"])
def test_a_stop_keeps_events_and_final_state(engine: str) -> None:
    machine, inputs = core_machine(heavy_table(100)), core_inputs(move(0.02, 0.03, 0.05, 0.3, 0.1))
    complete = _core.simulate(machine, inputs, end=2.0, engine=engine)
    half = complete.statistics["steps"] // 2
    if engine == "exact":  # which counts steps of the grid, not of the loop: many at once
        half = 3 * len(complete.events)
    result = _core.simulate(machine, inputs, end=2.0, engine=engine, max_steps=half)
    assert result.status == "too_many_steps"
    assert result.events == complete.events[: len(result.events)]
    assert len(result.events) > 5
    assert len(result.final_state) == len(result.state_names)
    assert result.t[-1] < 2.0


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
def test_ctrl_c_stops_a_long_run() -> None:
    """The run releases the GIL, yet a signal ends it within a second."""
    code = textwrap.dedent(
        """
        import signal
        from core_machines import core_machine
        from dualdrive import _core
        from reference_model import speed_study
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a background shell ignores it
        print("ready", flush=True)
        try:
            _core.simulate(core_machine(speed_study("H")), {"theta_ref": _core.sine(0.02, 0.5)},
                           end=1e5, output_step=10.0)
        except KeyboardInterrupt:
            print("stopped", flush=True)
        """
    )
    child = subprocess.Popen([sys.executable, "-c", code], cwd=TESTS, stdout=subprocess.PIPE,
                             text=True)  # fmt: skip
    try:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(0.5)
        child.send_signal(signal.SIGINT)
        assert child.communicate(timeout=PATIENCE)[0] == "stopped\n"
        assert child.returncode == 0
    finally:
        child.kill()
        child.wait()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"end": -1.0}, r"end = -1 s must be a finite time after start = 0 s"),
        ({"end": 1.0, "rtol": 1e-16}, r"rtol = 1e-16 must lie between"),
        ({"end": 1.0, "method": "euler"}, r"method = 'euler' is unknown; choose one of auto"),
        ({"end": 1.0, "output_step": 0.0}, r"output_step = 0 s must be positive"),
        ({"end": 1.0, "times": [0.5, 0.2]}, r"times\[1\] = 0.2 s must increase"),
        ({"end": 1.0, "times": [2.0]}, r"times\[0\] = 2 s must increase within start and end"),
        ({"end": 1.0, "initial": {"omega_x": 1.0}}, r"initial.omega_x: no such state"),
        ({"end": 1.0, "initial": {"omega_m": np.inf}}, r"initial.omega_m is not finite"),
        ({"end": 1.0, "signals": ["theta_x"]}, r"no signal named theta_x"),
        ({"end": 1.0, "sensitivities": ["table.K"]}, r"table.K: unknown"),
    ],
)
def test_what_makes_no_sense_is_refused_before_it_runs(
    options: dict[str, object], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        _core.simulate(under("-a * angle", a=1.0), {}, **options)  # type: ignore[arg-type]


# --------------------------------------------------------------- what settings may not change


@pytest.mark.parametrize("load", [0, 250])
def test_methods_agree(load: int) -> None:
    machine, motion = heavy_table(load), move(0.02, 0.03, 0.05, 0.3, start=0.1)
    exact = simulate(machine, motion, 2.0)
    runs = {method: run_like(machine, motion, 2.0, method=method) for method in ("adams", "bdf")}
    for method, run in runs.items():
        assert run.raw.statistics["method"] == method
        assert apart(run, exact) < 1e-6
    adams, bdf = (in_order(run.raw.events) for run in runs.values())
    assert [event[1:] for event in adams] == [event[1:] for event in bdf]


def in_order(events: Sequence[Switched]) -> list[Switched]:
    """By time, then by name: both drives break loose at once, but for rounding."""
    return sorted(events, key=lambda event: (round(event[0], 8), event[1]))


def test_method_is_chosen_by_what_the_machine_does() -> None:
    """A plant that rings wants Adams; one with a lag far faster than all else wants BDF."""
    machine = core_machine(bench())
    options = {"end": 0.1, "engine": "cvode"}
    automatic = _core.simulate(machine, core_inputs(sine(0.1, 1.0)), **options)  # type: ignore[arg-type]
    assert automatic.statistics["method"] == "adams"
    stiff = core_machine(bench().both(R=2e3, L=6e-3))  # L/R = 3 µs
    stiff.set_controller(current="voltage")
    automatic = _core.simulate(stiff, core_inputs(sine(0.1, 1.0)), **options)  # type: ignore[arg-type]
    assert automatic.statistics["method"] == "bdf"


def test_error_falls_with_the_tolerance_in_proportion() -> None:
    """Regressed over six decades: the order of error in rtol is about one."""
    machine, motion = bench(), sine(0.1, 1.0)
    exact = simulate(machine, motion, 1.0)
    exponents = np.arange(5, 12)
    errors = [
        apart(run_like(machine, motion, 1.0, rtol=10.0**-k, engine="cvode"), exact)
        for k in exponents
    ]
    order = np.polyfit(-exponents, np.log10(errors), 1)[0]
    assert order == pytest.approx(1.0, abs=0.25)
    assert errors[-1] < 1e-9


@pytest.mark.parametrize("output_step", [1e-4, 7e-3])
def test_outputs_do_not_steer_the_solver(output_step: float) -> None:
    """Dense output: however many rows are asked for, the steps and events are the same."""
    machine, motion = bench(), sine(0.1, 1.0)
    usual, other = (
        run_like(machine, motion, 0.7, output_step=h, engine="cvode") for h in (1e-3, output_step)
    )
    assert usual.raw.events == other.raw.events
    assert usual.raw.statistics["steps"] == other.raw.statistics["steps"]
    np.testing.assert_array_equal(usual.raw.final_state, other.raw.final_state)


@pytest.mark.parametrize("output_step", [1e-4, 7e-3])
def test_outputs_choose_the_exact_engines_grid_and_nothing_else(output_step: float) -> None:
    machine, motion = bench(), sine(0.1, 1.0)
    usual, other = (
        run_like(machine, motion, 0.7, output_step=h, engine="exact") for h in (1e-3, output_step)
    )
    assert [e[1:] for e in usual.raw.events] == [e[1:] for e in other.raw.events]
    for one, two in zip(usual.raw.events, other.raw.events, strict=True):
        assert one[0] == pytest.approx(two[0], abs=1e-13)
    np.testing.assert_allclose(usual.raw.final_state, other.raw.final_state, rtol=1e-11)


def test_a_run_may_start_at_any_time() -> None:
    """The same motion an hour later gives the same run."""
    machine = core_machine(bench())
    command = _core.jerk_limited_move(0.1, 1.0, 5.0, 50.0, 0.1)
    now = _core.simulate(machine, {"theta_ref": command}, end=1.0)
    later = _core.simulate(
        machine, {"theta_ref": _core.shift(command, 3600.0)}, start=3600.0, end=3601.0
    )
    np.testing.assert_allclose(later.t - 3600.0, now.t, atol=1e-9)
    peak = np.abs(now.values).max(axis=0)
    assert (np.abs(later.values - now.values).max(axis=0) <= 1e-6 * peak + 1e-12).all()
    np.testing.assert_allclose([e[0] - 3600.0 for e in later.events], [e[0] for e in now.events],
                               atol=1e-8)  # fmt: skip


def test_runs_repeat_bit_by_bit() -> None:
    machine, inputs = core_machine(bench()), core_inputs(sine(0.1, 1.0))
    first, second = (_core.simulate(machine, inputs, end=1.0) for _ in range(2))
    np.testing.assert_array_equal(first.values, second.values)
    assert first.events == second.events


def test_recording_energy_or_slopes_does_not_bend_the_run() -> None:
    machine, inputs = core_machine(bench()), core_inputs(sine(0.1, 1.0))
    plain = _core.simulate(machine, inputs, end=1.0, energy=False)
    peak = np.abs(plain.values).max(axis=0) + 1e-12
    for options in ({"energy": True}, {"sensitivities": ["meshes.gap", "table.J"]}):
        other = _core.simulate(machine, inputs, end=1.0, **options)
        assert (np.abs(other.values - plain.values).max(axis=0) / peak).max() < 1e-7
