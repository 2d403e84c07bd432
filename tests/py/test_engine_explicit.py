"""The explicit engine where laws are not affine: closed forms, a second integrator, slopes, ends.

Affine machines under it are held to the exact solution by the fixture `every_engine` of the oracle
tests.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, pi, sin

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipk

from core_machines import Array, Run, core_inputs, core_machine, run, set_all
from dualdrive import _core
from reference_model import Motion, bench, heavy_table, move, sine, speed_study, step


def body(J: float = 2.0) -> _core.Machine:
    machine = _core.Machine()
    machine.add_body("table")
    machine.set("table.J", J)
    return machine


def add(machine: _core.Machine, effect: str, place: str, **values: float) -> str:
    label = machine.add_effect(effect, place)
    set_all(machine, label, values)
    return label


# -------------------------------------------------------------------------------- closed forms


def test_a_rotor_in_its_cogging_swings_like_a_pendulum() -> None:
    """Period 4 K(sin² (n θ0 / 2)) / √(n a / J), to an amplitude where sin is far from its angle."""
    J, a, n, start = 2.0, 30.0, 6.0, 0.4
    machine = body(J)
    add(machine, "cogging", "table", amplitude=a, order=n, phase=pi)
    period = 4 * ellipk(sin(n * start / 2) ** 2) / np.sqrt(n * a / J)
    swing = run(machine, end=20 * period, initial={"theta_m": start}, rtol=1e-12,
                engine="explicit", times=[k * period for k in range(1, 21)])  # fmt: skip
    np.testing.assert_allclose(swing["theta_m"], start, rtol=1e-9)
    np.testing.assert_allclose(swing["omega_m"], 0, atol=1e-6)


def test_a_table_comes_to_rest_on_its_stribeck_curve() -> None:
    """Stopped after ∫ J dω / F(ω), having gone ∫ J ω dω / F(ω)."""
    J, level, ratio, speed, start = 2.0, 3.0, 1.5, 0.2, 1.0

    def friction(w: float) -> float:
        return level * (1 + (ratio - 1) * exp(-((w / speed) ** 2)))

    machine = body(J)
    add(machine, "stribeck", "table", torque=level, static_ratio=ratio, speed=speed)
    rest = run(machine, end=1.0, initial={"omega_m": start}, rtol=1e-12, engine="explicit")
    ((t, element, before, after),) = rest.raw.events
    assert (element, before, after) == ("friction of m", "forward", "stuck")
    assert t == pytest.approx(quad(lambda w: J / friction(w), 0, start, epsabs=1e-13)[0], rel=1e-10)
    way = quad(lambda w: J * w / friction(w), 0, start, epsabs=1e-13)[0]
    assert rest["theta_m"][-1] == pytest.approx(way, rel=1e-10)


def test_a_drag_that_goes_with_the_square_of_speed() -> None:
    J, c, start = 2.0, 3.0, -4.0
    machine = body(J)
    machine.add_expression("table", "-c * speed * abs(speed)", [("c", "", c)])
    drag = run(machine, end=2.0, initial={"omega_m": start}, rtol=1e-12, engine="explicit")
    np.testing.assert_allclose(
        drag["omega_m"], start / (1 + c * abs(start) / J * drag.t), rtol=1e-10
    )


@pytest.mark.long
def test_bristles_bend_slip_and_spring_back() -> None:
    """A table on LuGre friction, pulled back and forth, as Radau sees it."""
    J, pull, w = 2.0, 5.0, 12.0
    level, ratio, speed, stiffness, damping = 3.0, 1.4, 0.05, 2e3, 4.0

    def rates(t: float, y: Array) -> list[float]:
        omega, z, _ = y
        g = level * (1 + (ratio - 1) * np.exp(-((omega / speed) ** 2)))
        z_rate = omega - stiffness * abs(omega) / g * z
        return [(pull * np.sin(w * t) - stiffness * z - damping * z_rate) / J, z_rate, omega]

    machine = body(J)
    add(machine, "lugre", "table", torque=level, static_ratio=ratio, speed=speed,
        stiffness=stiffness, damping=damping)  # fmt: skip
    inputs = {"T_load": _core.sine(-pull, w / (2 * pi))}
    seen = run(machine, inputs, end=1.5, rtol=1e-11, engine="explicit")
    truth = solve_ivp(rates, (0, 1.5), [0, 0, 0], "Radau", seen.t, rtol=1e-10, atol=1e-12,
                      max_step=1e-3)  # fmt: skip
    np.testing.assert_allclose(seen["omega_m"], truth.y[0], atol=1e-8 * np.abs(truth.y[0]).max())
    np.testing.assert_allclose(seen["theta_m"], truth.y[2], atol=1e-8 * np.abs(truth.y[2]).max())


@pytest.mark.parametrize("at", [0.3, 0.30037])
def test_a_short_push_is_not_slept_through(at: float) -> None:
    """2 ms up and down, without a jump even of the second derivative: nothing to stop at."""
    J, h, top = 2.0, 1e-3, 50.0
    up = top * np.array([0, 0, 0, 10 / h**3, -15 / h**4, 6 / h**5])
    down = np.array([top, 0, 0, *-up[3:]])
    rest = np.zeros(6)
    push = _core.Waveform([at, at + h, at + 2 * h], [rest, up, down, rest])
    knocked = run(body(J), {"T_load": push}, end=1.0, rtol=1e-8, engine="explicit")
    assert knocked["omega_m"][-1] == pytest.approx(-top * h / J, rel=1e-6)


# --------------------------------------------------------------- whole machines, as CVODE sees them

QUICK = move(0.02, 0.03, 0.05, 0.3, start=0.2)
THROWN = {"omega_c1": 0.05, "omega_c2": 0.04, "mesh_1.twist": 1e-4, "theta_m": 1e-4}
Case = tuple[_core.Machine, Motion, float, dict[str, float]]


def heavy(*, dry_friction: bool = False) -> _core.Machine:
    return core_machine(heavy_table(100, dry_friction=dry_friction).control(T_ten=10.0))


def stribeck() -> Case:
    machine = heavy()
    add(machine, "stribeck", "table", torque=2e3, static_ratio=1.3, speed=2e-3)
    add(machine, "stribeck", "pinion_1", torque=300, static_ratio=1.5, speed=4e-2)
    return machine, QUICK, 1.2, THROWN


def lugre() -> Case:
    machine = heavy()
    add(machine, "lugre", "table", torque=2e3, speed=2e-3, stiffness=2e8, damping=1e5)
    return machine, QUICK, 1.2, THROWN


def eccentric_ring_and_pinion() -> Case:
    machine = heavy()
    add(machine, "eccentricity", "table", amplitude=3e-4, phase=0.5, spacing=1.0)
    add(machine, "eccentricity", "pinion_2", amplitude=2e-4, phase=1.0)
    return machine, QUICK, 1.2, THROWN


def cogging_and_ripple() -> Case:
    machine = heavy(dry_friction=True)
    for n in (1, 2):
        add(machine, "cogging", f"motor_{n}", amplitude=2.0, order=24, phase=0.3 * n)
        add(machine, "torque_ripple", f"motor_{n}", amplitude=0.05, order=12)
    return machine, QUICK, 1.2, THROWN


def formulas() -> Case:
    machine = heavy()
    machine.add_expression("table", "-c * speed * abs(speed)", [("c", "", 1e7)])
    machine.add_expression("pinion_1", "-a * tanh(speed / v)", [("a", "", 300), ("v", "", 1e-2)])
    return machine, QUICK, 1.2, THROWN


def slave_lag() -> Case:
    machine = heavy()
    machine.set("controller.delta_t", 0.02)
    motion = step(1e-3, at=0.1) + move(0.02, 0.03, 0.05, 0.3, start=0.5, origin=1e-3)
    return machine, motion, 1.2, THROWN


def late_sensor_and_sampled_loops() -> Case:
    machine = heavy(dry_friction=True)
    add(machine, "sensor_delay", "table", time=2e-3)
    add(machine, "torque_ripple", "motor_1", amplitude=0.05, order=12)
    clocks = {"position": 4e-3, "tension": 4e-3, "speed": 2e-3, "current": 5e-4}
    set_all(machine, "controller", {f"{loop}_sample": time for loop, time in clocks.items()})
    return machine, QUICK, 0.7, THROWN


def ripple_among_impacts() -> Case:
    machine = core_machine(speed_study("H"))
    add(machine, "torque_ripple", "motor_1", amplitude=0.02, order=24)
    return machine, sine(0.02, 0.5), 2.0, {}


CASES = [stribeck, lugre, eccentric_ring_and_pinion, cogging_and_ripple, formulas, slave_lag,
         late_sensor_and_sampled_loops, ripple_among_impacts]  # fmt: skip


def seen_by(engine: str, case: Case, rtol: float, **options: object) -> Run:
    machine, motion, end, initial = case
    return run(machine, core_inputs(motion), end, initial=initial, rtol=rtol, engine=engine,
               **options)  # type: ignore[arg-type]  # fmt: skip


def states(seen: Run) -> Array:
    wanted = ("theta_", "omega_", "I_")
    return np.column_stack([seen[name] for name in seen.raw.names
                            if name.startswith(wanted) or name.endswith("twist")])  # fmt: skip


def off(seen: Run, truth: Run) -> float:
    """The worst state's largest difference, over its own peak."""
    peak = np.abs(states(truth)).max(axis=0)
    worst = np.abs(states(seen) - states(truth)).max(axis=0)
    return float((worst / np.where(peak > 0, peak, 1)).max())


METHODS = {"explicit": "dop853", "exponential": "exponential"}


@pytest.mark.parametrize("engine", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_machines_with_smooth_effects_move_as_cvode_says(
    case: Callable[[], Case], engine: str
) -> None:
    truth = seen_by("cvode", case(), 1e-13)
    errors = []
    for rtol in (1e-7, 1e-10):
        seen = seen_by(engine, case(), rtol)
        assert seen.raw.statistics["method"] == METHODS[engine]
        errors.append(off(seen, truth))
    assert errors[1] < max(1e-9, errors[0] / 30)
    assert errors[1] < 1e-7
    # friction of two bodies may stop at one instant, in either order
    last, first = (sorted((element, to, round(t, 6)) for t, element, _, to in r.raw.events)
                   for r in (seen, truth))  # fmt: skip
    assert len(truth.raw.events) > 5
    assert [e[:2] for e in last] == [e[:2] for e in first]
    np.testing.assert_allclose([e[2] for e in last], [e[2] for e in first], atol=2e-6)


@pytest.mark.parametrize("engine", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_energy_is_accounted_for(case: Callable[[], Case], engine: str) -> None:
    assert seen_by(engine, case(), 1e-10).raw.statistics["energy_error"] < 1e-8


# --------------------------------------------------------------------------------------- slopes

PARAMETERS = {
    stribeck: ("stribeck@table.torque", "stribeck@table.speed", "stribeck@pinion_1.static_ratio"),
    lugre: ("lugre@table.torque", "lugre@table.stiffness", "lugre@table.speed"),
    eccentric_ring_and_pinion: ("eccentricity@table.amplitude", "eccentricity@pinion_2.phase"),
    cogging_and_ripple: ("cogging@motor_1.amplitude", "torque_ripple@motor_2.order"),
    formulas: ("expression@table.c", "expression@pinion_1.v"),
    slave_lag: ("controller.delta_t",),
    late_sensor_and_sampled_loops: ("torque_ripple@motor_1.phase",),
}
ALWAYS = ("table.J", "meshes.gap", "controller.K_v", "initial.omega_c1")
KINK = 2e-3  # s: a difference across a switch that moves past an output time means nothing


def changed(case: Case, path: str, by: float) -> Case:
    machine, motion, end, initial = case
    if path.startswith("initial."):
        return machine, motion, end, initial | {path[8:]: initial[path[8:]] + by}
    other = machine.copy()
    other.set(path, machine.get(path) + by)
    return other, motion, end, initial


@pytest.mark.parametrize("case", PARAMETERS)
def test_sensitivities_are_the_slopes_of_the_runs(case: Callable[[], Case]) -> None:
    this = case()
    switches = [event[0] for event in seen_by("explicit", this, 1e-9).raw.events]
    times = [t for t in np.linspace(this[2] / 37, this[2], 37)
             if all(abs(t - at) > KINK for at in switches)]  # fmt: skip
    assert len(times) > 12
    names = (*ALWAYS, *PARAMETERS[case])
    nominal = seen_by("explicit", this, 1e-11, times=times, sensitivities=names)
    for path in names:
        size = abs(this[3][path[8:]] if path.startswith("initial.") else this[0].get(path))
        size = size or 1.0  # a phase
        h = 1e-5 * size
        up, down = (
            seen_by("explicit", changed(this, path, d), 1e-12, times=times) for d in (h, -h)
        )
        for signal in ("theta_m", "omega_m", "omega_c1", "omega_c2", "I_1", "I_2"):
            slope = nominal.slope(signal, path) * size
            difference = (up[signal] - down[signal]) / (2 * h) * size
            peak = np.abs(nominal[signal]).max()
            allowed = 3e-4 * np.abs(slope).max() + 1e-4 * peak
            np.testing.assert_allclose(slope, difference, atol=allowed, err_msg=f"{signal} {path}")


# ----------------------------------------------------------------------- which engine, and its ends


def test_auto_takes_it_where_the_exponential_engine_has_no_long_steps() -> None:
    machine, motion, _, initial = cogging_and_ripple()
    auto = run(machine, core_inputs(motion), 0.1, initial=initial)
    assert auto.raw.statistics["method"] == "exponential"
    slopes = run(machine, core_inputs(motion), 0.1, initial=initial, sensitivities=["table.J"])
    assert slopes.raw.statistics["method"] == "exponential"
    late, motion, _, initial = late_sensor_and_sampled_loops()
    assert run(late, core_inputs(motion), 0.1, initial=initial).raw.statistics["method"] == "dop853"
    adams = run(machine, core_inputs(motion), 0.1, initial=initial, method="adams")
    assert adams.raw.statistics["method"] == "adams"


def test_auto_leaves_a_stiff_machine_to_bdf() -> None:
    machine = core_machine(bench().both(R=2e3, L=6e-3))  # L/R = 3 µs
    machine.set_controller(current="voltage")
    add(machine, "cogging", "motor_1", amplitude=1e-3, order=12)
    auto = run(machine, core_inputs(sine(0.1, 1.0)), 0.1)
    assert auto.raw.statistics["method"] == "bdf"


def sliding_bristles() -> Case:
    """Mild at rest; when the motors turn, their bristles forget within 0.1 ms."""
    machine = heavy()
    for n in (1, 2):
        add(machine, "lugre", f"motor_{n}", torque=0.5, stiffness=1e5, damping=1.0, speed=1.0)
    return machine, QUICK, 0.4, {}


def test_a_machine_that_turns_stiff_is_handed_over() -> None:
    truth = seen_by("cvode", sliding_bristles(), 1e-12, method="bdf")
    auto = seen_by("auto", sliding_bristles(), 1e-10)
    assert auto.raw.statistics["method"].endswith("bdf")
    assert off(auto, truth) < 1e-6
    alone = seen_by("explicit", sliding_bristles(), 1e-10)
    assert alone.raw.statistics["method"] == "dop853"
    assert alone.raw.statistics["rhs"] > 5 * auto.raw.statistics["rhs"]
    assert off(alone, truth) < 1e-6


def test_slopes_are_handed_over_too() -> None:
    names = ("table.J", "controller.K_v", "lugre@motor_1.torque")
    auto = seen_by("auto", sliding_bristles(), 1e-10, sensitivities=names)
    truth = seen_by("cvode", sliding_bristles(), 1e-12, method="bdf", sensitivities=names)
    assert auto.raw.statistics["method"].endswith(", bdf")
    for name in names:
        for signal in ("theta_m", "omega_m"):
            expected = truth.slope(signal, name)
            np.testing.assert_allclose(auto.slope(signal, name), expected,
                                       atol=1e-5 * np.abs(expected).max())  # fmt: skip


@pytest.mark.long
def test_slopes_pass_a_kink_however_tight_the_tolerance() -> None:
    """A motor reverses on its bristles: |speed| has a kink, slopes by a gain have a jump."""
    machine, motion, _, initial = sliding_bristles()
    case = machine, motion, 0.25, initial
    names = ("controller.K_v", "lugre@motor_1.torque")
    truth = seen_by("cvode", case, 1e-12, method="bdf", sensitivities=names)
    for rtol in (1e-11, 1e-13):
        seen = seen_by("explicit", case, rtol, sensitivities=names)
        for name in names:
            expected = truth.slope("omega_1", name)
            np.testing.assert_allclose(seen.slope("omega_1", name), expected,
                                       atol=1e-7 * np.abs(expected).max())  # fmt: skip


def under(torque: str, **numbers: float) -> _core.Machine:
    machine = body()
    machine.add_expression("table", torque, [(name, "", v) for name, v in numbers.items()])
    return machine


@pytest.mark.parametrize(
    ("machine", "options", "status", "message"),
    [
        (under("sqrt(a - t)", a=0.1), {}, "not_finite", "not finite"),
        (under("log(speed)"), {}, "not_finite", "not finite"),
        (under("a * speed^3", a=2.0), {"initial": {"omega_m": 2.0}}, "step_too_small", "bdf"),
        (under("-a * angle", a=1e4), {"initial": {"omega_m": 2.0}, "max_steps": 20},
         "too_many_steps", "max_steps = 20"),
        (under("-a * sign(speed - t)", a=10.0), {"initial": {"omega_m": 0.3}}, "chattering",
         "switches without end"),
    ],
)  # fmt: skip
def test_every_end_has_its_status(
    machine: _core.Machine, options: dict[str, object], status: str, message: str
) -> None:
    result = _core.simulate(machine, {}, end=1.0, engine="explicit", **options)  # type: ignore[arg-type]
    assert result.status == status
    assert message in result.message
    rows = len(result.t)
    assert result.values.shape == (rows, len(result.names))
    assert np.isfinite(result.values).all()
    assert np.isfinite(result.work).all()


def test_runs_repeat_bit_by_bit_whatever_is_recorded() -> None:
    first = seen_by("explicit", ripple_among_impacts(), 1e-9)
    second = seen_by("explicit", ripple_among_impacts(), 1e-9)
    sparse = seen_by("explicit", ripple_among_impacts(), 1e-9, output_step=0.5)
    np.testing.assert_array_equal(first.raw.values, second.raw.values)
    assert first.raw.events == second.raw.events == sparse.raw.events
