"""The gradient of a cost by the way back: against forward sensitivities and against differences."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest

import test_oracle_sensitivities as forward
from core_machines import core_inputs, core_machine
from dualdrive import Machine, _core, simulate
from dualdrive.run import RunError
from reference_model import heavy_table, move
from test_oracle_sensitivities import Case

RANDOM = np.random.default_rng(20261121)


def saturations() -> Case:
    """Every limit is met, and ridden; without the delay, which the exact engine doesn't take."""
    case = forward.saturations()
    case.machine.set("controller.delta_t", 0.0)
    case.parameters = tuple(name for name in case.parameters if name != "controller.delta_t")
    return case


CASES = (forward.plain, forward.mesh_damping, forward.dry_friction, forward.sampled_loops,
         forward.differenced_encoder, saturations, forward.bench_default,
         forward.heavy_default)  # fmt: skip


def trajectory(case: Case, rows: int, **options: object) -> _core.Trajectory:
    times = np.linspace(case.end / rows, case.end, rows)  # between grid times, mostly
    return _core.simulate(case.machine, core_inputs(case.motion), end=case.end, energy=False,
                          initial=dict(case.initial), times=times.tolist(),
                          signals=list(forward.SIGNALS), **options)  # type: ignore[arg-type] # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_back_is_forward_summed(case: Callable[[], Case]) -> None:
    """Both are exact derivatives of one run, by algorithms that share little: to rounding."""
    this = case()
    ahead = trajectory(this, 371, sensitivities=list(this.parameters))
    back = trajectory(this, 371, gradient=list(this.parameters))
    assert np.array_equal(ahead.values, back.values)
    assert len(back.events) > 4
    for _ in range(2):  # the tape can be walked again
        seeds = RANDOM.normal(size=back.values.shape) / np.abs(back.values).max(axis=0)
        gradient = back.pull_back(seeds)
        expected = np.einsum("ts,tsp->p", seeds, ahead.sensitivities)
        size = np.einsum("ts,tsp->p", np.abs(seeds), np.abs(ahead.sensitivities))
        assert np.abs(gradient - expected).max() > 0
        np.testing.assert_array_less(np.abs(gradient - expected), 1e-11 * size)


def quadratic(case: Case, weight: np.ndarray, path: str, change: float) -> float:
    """Σ (w v)² of the run in long double with one parameter changed."""
    machine, initial = case.machine.copy(), dict(case.initial)
    if path.startswith("initial."):
        initial[path[8:]] += change
    else:
        machine.set(path, machine.get(path) + change)
    changed = Case(machine, case.motion, case.end, (), initial)
    return float(np.sum((weight * trajectory(changed, 60, long_double=True).values) ** 2))


@pytest.mark.parametrize("case", [forward.plain, forward.mesh_damping, forward.bench_default])
def test_a_cost_against_differences_in_long_double(case: Callable[[], Case]) -> None:
    """Central differences, two step sizes extrapolated; the reference shares no derivative."""
    this = case()
    run = trajectory(this, 60, gradient=list(this.parameters))
    weight = 1.0 / np.abs(run.values).max(axis=0)
    gradient = run.pull_back(2 * weight**2 * run.values)
    total = float(np.sum((weight * run.values) ** 2))
    for k, path in enumerate(this.parameters):
        size = this.size(path)

        def slope(step: float, path: str = path, size: float = size) -> float:
            up, down = (quadratic(this, weight, path, sign * step * size) for sign in (1, -1))
            return (up - down) / (2 * step)

        tries = [(4 * slope(h) - slope(2 * h)) / 3 for h in (1e-4, 2e-5)]
        error = min(abs(gradient[k] * size - found) for found in tries)
        assert error < 1e-6 * max(abs(gradient[k] * size), 1e-3 * total), path


def test_a_free_bounce_in_closed_form() -> None:
    """The cost is where the pinion is on its flight back."""
    machine, v, end, _, slopes = forward.free_bounce()
    run = _core.simulate(machine, {}, end=end, times=[end], initial={"omega_c1": v},
                         signals=["mesh_1.twist"], gradient=list(slopes))  # fmt: skip
    np.testing.assert_allclose(run.pull_back(np.ones((1, 1))), list(slopes.values()), rtol=1e-9)


# ------------------------------------------------------------------------------------- the façade


def small(**options: object) -> dict[str, object]:
    return {"end": 1.5, "output_step": 5e-3, "signals": ["theta_m", "omega_m"], **options}


@pytest.fixture(scope="module")
def bench() -> Machine:
    return Machine.load("bench")


def test_run_gradient_takes_an_array_or_columns(bench: Machine) -> None:
    names = ("controller.K_v", "table.J")
    run = simulate(bench, gradient=names, **small())  # type: ignore[arg-type]
    assert run.gradient_parameters == names
    seeds = np.zeros(run.values.shape)
    seeds[:, 1] = np.linspace(-1, 1, len(run.t))
    whole = run.gradient(seeds)
    assert whole.shape == (2,)
    assert np.array_equal(whole, run.gradient({"omega_m": seeds[:, 1]}))
    ahead = simulate(bench, sensitivities=names, **small())  # type: ignore[arg-type]
    np.testing.assert_allclose(whole, seeds[:, 1] @ ahead.sensitivities[:, 1], rtol=1e-9)


def test_gradients_that_cannot_be_had_say_why(bench: Machine) -> None:
    plain = simulate(bench, **small())  # type: ignore[arg-type]
    with pytest.raises(RunError, match="kept no tape; name its parameters in gradient"):
        plain.gradient(np.zeros(plain.values.shape))
    run = simulate(bench, gradient=["table.J"], **small())  # type: ignore[arg-type]
    with pytest.raises(RunError, match=r"seeds of shape 3 x 2 for 301 times x 2 signals"):
        run.gradient(np.zeros((3, 2)))
    with pytest.raises(RunError, match="not all finite"):
        run.gradient(np.full(run.values.shape, np.nan))
    with pytest.raises(KeyError, match="omega_n"):
        run.gradient({"omega_n": 1.0})
    with pytest.raises(RunError, match="has lost the way back"):
        pickle.loads(pickle.dumps(run)).gradient(np.zeros(run.values.shape))
    with pytest.raises(ValueError, match="goes back or forward; ask for one"):
        simulate(bench, gradient=["table.J"], sensitivities=["table.J"], **small())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="energies and torques of effects are not"):
        simulate(bench, gradient=["table.J"], end=0.1)
    stopped = simulate(bench, gradient=["table.J"], max_steps=3, **small())  # type: ignore[arg-type]
    assert stopped.status == "too_many_steps"
    with pytest.raises(RunError, match="stopped early"):
        stopped.gradient(np.zeros(stopped.values.shape))


def test_only_the_exact_engine_goes_back() -> None:
    machine = core_machine(heavy_table(100))
    motion = core_inputs(move(0.02, 0.03, 0.05, 0.3, start=0.0))
    options = {"end": 0.1, "signals": ["theta_m"], "gradient": ["table.J"]}
    with pytest.raises(ValueError, match=r"gradient: .*engine = cvode"):
        _core.simulate(machine, motion, engine="cvode", **options)  # type: ignore[arg-type]
    machine.add_effect("stribeck", "table")
    with pytest.raises(ValueError, match=r"gradient: .*not affine.*ask for sensitivities"):
        _core.simulate(machine, motion, **options)  # type: ignore[arg-type]
