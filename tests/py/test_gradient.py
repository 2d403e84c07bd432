"""The gradient of a cost by the way back: against forward sensitivities and against differences."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest

import test_oracle_sensitivities as forward
import usual_laws
from core_machines import core_inputs, core_machine, set_all
from dualdrive import Machine, _core, simulate
from dualdrive.run import RunError
from reference_model import bench as bench_of_reference
from reference_model import heavy_table, move, sine
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


def check_back(back: _core.Trajectory, ahead: _core.Trajectory, allowed: float) -> None:
    """The gradient of a random cost, twice over one tape, against forward slopes summed.

    allowed: of what these add up to in size
    """
    seeds = RANDOM.normal(size=back.values.shape) / np.abs(back.values).max(axis=0)
    expected = np.einsum("ts,tsp->p", seeds, ahead.sensitivities)
    size = np.einsum("ts,tsp->p", np.abs(seeds), np.abs(ahead.sensitivities))
    gradient = back.pull_back(seeds)
    assert np.abs(expected).max() > 0
    assert np.all(np.abs(gradient - expected) <= allowed * size)
    np.testing.assert_array_equal(gradient, back.pull_back(seeds))  # the tape can be walked again


@pytest.mark.parametrize("case", CASES)
def test_back_is_forward_summed(case: Callable[[], Case]) -> None:
    """Both are exact derivatives of one run, by algorithms that share little: to rounding."""
    this = case()
    ahead = trajectory(this, 371, sensitivities=list(this.parameters))
    back = trajectory(this, 371, gradient=list(this.parameters))
    assert np.array_equal(ahead.values, back.values)
    assert len(back.events) > 4
    check_back(back, ahead, 1e-11)


@pytest.mark.parametrize("case", CASES)
def test_collocation_goes_back_as_the_exact_engine_does(case: Callable[[], Case]) -> None:
    """Of affine machines: two engines that share neither steps nor laws, nor what they owe to A."""
    this = case()
    exact = trajectory(this, 83, gradient=list(this.parameters))
    other = trajectory(this, 83, gradient=list(this.parameters), engine="exponential", rtol=1e-12)
    ahead = trajectory(this, 83, sensitivities=list(this.parameters))
    seeds = RANDOM.normal(size=exact.values.shape) / np.abs(exact.values).max(axis=0)
    size = np.einsum("ts,tsp->p", np.abs(seeds), np.abs(ahead.sensitivities))
    gone = np.abs(other.pull_back(seeds) - exact.pull_back(seeds))
    np.testing.assert_array_less(gone, 1e-9 * size)


def quadratic(case: Case, weight: np.ndarray, path: str, change: float, **options: object) -> float:
    """Σ (w v)² of the run with one parameter changed."""
    machine, initial = case.machine.copy(), dict(case.initial)
    if path.startswith("initial."):
        initial[path[8:]] += change
    else:
        machine.set(path, machine.get(path) + change)
    changed = Case(machine, case.motion, case.end, (), initial)
    return float(np.sum((weight * trajectory(changed, 60, **options).values) ** 2))


def check_against_differences(case: Case, run: _core.Trajectory, **options: object) -> None:
    """Central differences, two step sizes extrapolated; they share no derivative."""
    weight = 1.0 / np.abs(run.values).max(axis=0)
    gradient = run.pull_back(2 * weight**2 * run.values)
    total = float(np.sum((weight * run.values) ** 2))
    for k, path in enumerate(case.parameters):
        size = case.size(path)

        def slope(step: float, path: str = path, size: float = size) -> float:
            up, down = (quadratic(case, weight, path, sign * step * size, **options)
                        for sign in (1, -1))  # fmt: skip
            return (up - down) / (2 * step)

        tries = [(4 * slope(h) - slope(2 * h)) / 3 for h in (1e-4, 2e-5)]
        error = min(abs(gradient[k] * size - found) for found in tries)
        assert error < 1e-6 * max(abs(gradient[k] * size), 1e-3 * total), path


@pytest.mark.long
@pytest.mark.parametrize("case", [forward.plain, forward.mesh_damping, forward.bench_default])
def test_a_cost_against_differences_in_long_double(case: Callable[[], Case]) -> None:
    this = case()
    run = trajectory(this, 60, gradient=list(this.parameters))
    check_against_differences(this, run, long_double=True)


def test_a_free_bounce_in_closed_form() -> None:
    """The cost is where the pinion is on its flight back."""
    machine, v, end, _, slopes = forward.free_bounce()
    run = _core.simulate(machine, {}, end=end, times=[end], initial={"omega_c1": v},
                         signals=["mesh_1.twist"], gradient=list(slopes))  # fmt: skip
    np.testing.assert_allclose(run.pull_back(np.ones((1, 1))), list(slopes.values()), rtol=1e-9)


# ---------------------------------------------------------------------- laws that are not affine


def add_law(machine: _core.Machine, law: str) -> list[str]:
    """Add a law where it usually sits; return its numbers, by one path for all places."""
    places, values = usual_laws.LAWS[law]
    labels = [machine.add_effect(law, place) for place in places]
    for label in labels:
        set_all(machine, label, values)
    return [f"{labels[0]}.{name}" for name, value in values.items() if value != 0.0]


def with_laws(*laws: str) -> Case:
    """The bench; its meshes switch."""
    machine = core_machine(bench_of_reference().control(omega_ci=2500.0))
    machine.set("motors.T_rated", 1.27)
    own = [name for law in laws for name in add_law(machine, law)]
    start = {"omega_c1": 0.05, "theta_m": 1e-3}
    names = (*own, "meshes.gap", "table.J", "motor_1.J", "mesh_1.stiffness", "meshes.ratio",
             "controller.K_v", "controller.k_p", "controller.T_ten",
             *(f"initial.{name}" for name in start))  # fmt: skip
    return Case(machine, sine(0.3, 0.5), 1.2, names, start)


def and_laws(case: Callable[[], Case], *laws: str) -> Case:
    """Impacts of damped contacts, ticks, limits: of an affine case, with laws that are not."""
    this = case()
    this.machine.set("motors.T_rated", 1.27)
    own = [name for law in laws for name in add_law(this.machine, law)]
    this.parameters = (*own, *this.parameters)
    return this


RIPPLE, STRIBECK = "torque_ripple", "stribeck"
LAWS = {law: (lambda law=law: with_laws(law)) for law in usual_laws.LAWS if law != "lugre"}
MIXED: dict[str, Callable[[], Case]] = {
    "ripple and Stribeck": lambda: with_laws(RIPPLE, STRIBECK),
    "with impacts": lambda: and_laws(forward.mesh_damping, RIPPLE, STRIBECK),
    "with dry friction": lambda: and_laws(forward.dry_friction, RIPPLE, "transmission_error"),
    "with sampled loops": lambda: and_laws(forward.sampled_loops, RIPPLE, STRIBECK),
    "with encoders": lambda: and_laws(forward.differenced_encoder, "eccentricity"),
    "with limits": lambda: and_laws(saturations, RIPPLE),
}


def without_size() -> Case:
    """Laws that are there with nothing to say yet: what a fit begins with."""
    case = with_laws("torque_ripple", "transmission_error", "stribeck", "cutting_torque")
    for path in ("torque_ripple@motor_1.amplitude", "torque_ripple@motor_2.amplitude",
                 "transmission_error@mesh_1.amplitude", "cutting_torque@table.mean",
                 "cutting_torque@table.amplitude"):  # fmt: skip
        case.machine.set(path, 0.0)
    case.machine.set("cutting_torque@table.start", 0.4)
    return case


def of_a_user() -> Case:
    case = with_laws()
    machine = case.machine
    machine.add_expression("table", "gain * sin(3 * angle) * abs(speed)", [("gain", "", 0.5)])
    machine.add_spline("table", [("angle", -0.3, 0.1, 6, False)], [0.0] * 6)
    machine.add_spline(
        "pinion_1", [("speed", -5.0, 5.0, 6, False)], [0.2, 0.1, 0.0, 0.0, -0.1, -0.2]
    )
    case.parameters += ("expression@table.gain", "spline@table.value_3", "spline@pinion_1.value_1",
                        "spline@pinion_1.value_2")  # fmt: skip
    return case


def fast_without_size() -> Case:
    """Of an affine run, whose steps are long beside the ripple's period."""
    case = with_laws("torque_ripple")
    for motor in ("motor_1", "motor_2"):
        set_all(case.machine, f"torque_ripple@{motor}", {"amplitude": 0.0, "order": 36.0})
    case.parameters = case.parameters[:1]
    return case


MIXED |= {
    "without size": without_size,
    "fast without size": fast_without_size,
    "of a user": of_a_user,
}


@pytest.mark.long
@pytest.mark.parametrize("name", [*LAWS, *MIXED])
def test_back_through_laws_is_forward_summed(name: str) -> None:
    """Back by collocation; forward by the explicit engine, which shares no step with it."""
    this = (LAWS | MIXED)[name]()
    ahead = trajectory(this, 83, engine="explicit", rtol=1e-12,
                       sensitivities=list(this.parameters))  # fmt: skip
    back = trajectory(this, 83, rtol=1e-11, gradient=list(this.parameters))
    assert back.statistics["method"] == "exponential"
    assert [event[1:] for event in back.events] == [event[1:] for event in ahead.events]
    check_back(back, ahead, 1e-7)


@pytest.mark.long
@pytest.mark.parametrize("name", ["ripple and Stribeck", "with impacts", "with sampled loops"])
def test_a_cost_of_laws_against_differences(name: str) -> None:
    this = MIXED[name]()
    this.parameters = this.parameters[:12]
    run = trajectory(this, 60, rtol=1e-11, gradient=list(this.parameters))
    check_against_differences(this, run, engine="explicit", rtol=1e-13)


@pytest.mark.parametrize("signals", [
    ["alpha_m", "energy.stored", "torque_ripple@motor_1", "T_1"],  # the model itself goes back
    ["theta_1", "omega_1", "U_1", "e"],  # affine, and scaled by parameters
])  # fmt: skip
def test_any_signal_has_a_way_back_through_laws(signals: list[str]) -> None:
    case = with_laws("torque_ripple", "hertzian_stiffness")
    names = [*case.parameters, "gearboxes.ratio", "motors.K_d"]
    options = {"end": 0.8, "signals": signals, "initial": dict(case.initial), "output_step": 7e-3}
    motion = core_inputs(case.motion)
    ahead = _core.simulate(case.machine, motion, engine="explicit", rtol=1e-12,
                           sensitivities=names, **options)  # type: ignore[arg-type]  # fmt: skip
    back = _core.simulate(case.machine, motion, rtol=1e-11, gradient=names, **options)  # type: ignore[arg-type]
    check_back(back, ahead, 1e-6)


def test_a_recorded_command_changes_its_form_within_steps_back() -> None:
    """Knots of a smooth command at 7 ms, of which nothing else is a multiple."""
    case = with_laws("unbalance", "torque_ripple")
    knots = np.arange(0.0, 1.6, 7e-3)
    command = {
        "theta_ref": _core.sampled(knots, 0.3 * np.sin(np.pi * knots), _core.Interpolation.cubic)
    }
    options = {"end": 1.1, "signals": ["theta_m", "omega_m", "I_1"], "output_step": 1e-2,
               "initial": dict(case.initial)}  # fmt: skip
    names = list(case.parameters)
    ahead = _core.simulate(case.machine, command, engine="explicit", rtol=1e-12,
                           sensitivities=names, **options)  # type: ignore[arg-type]  # fmt: skip
    back = _core.simulate(case.machine, command, rtol=1e-11, gradient=names, **options)  # type: ignore[arg-type]
    check_back(back, ahead, 1e-7)


@pytest.mark.parametrize("case", [forward.dry_friction, MIXED["with impacts"]])
def test_the_same_gradient_has_the_same_bits(case: Callable[[], Case]) -> None:
    """Wherever memory was: runs are kept, so that each has another place."""
    this = case()
    runs = [trajectory(this, 60, gradient=list(this.parameters)) for _ in range(6)]
    assert len({run.pull_back(run.values).tobytes() for run in runs}) == 1


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


def test_machines_and_engines_without_a_way_back_say_so() -> None:
    motion = core_inputs(move(0.02, 0.03, 0.05, 0.3, start=0.0))

    def refused(machine: _core.Machine, words: str, **options: object) -> None:
        given = {"end": 0.1, "signals": ["theta_m"], "gradient": ["table.J"], **options}
        with pytest.raises(ValueError, match=f"^gradient: .*{words}"):
            _core.simulate(machine, motion, **given)  # type: ignore[arg-type]

    machine = core_machine(heavy_table(100))
    for engine in ("cvode", "explicit"):
        refused(machine, f"engine = {engine} has no way back; take engine = auto", engine=engine)
    late = machine.copy()
    late.add_effect("stribeck", "table")
    refused(late, "stribeck@table is not affine.*; take engine = auto", engine="exact")
    late.set("controller.delta_t", 2e-3)
    refused(late, "delays a signal inside the loop; ask for sensitivities")
    machine.add_effect("lugre", "table")
    for engine in ("auto", "exponential"):
        refused(machine, "lugre@table keeps a state.*; ask for sensitivities", engine=engine)
