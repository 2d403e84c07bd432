"""Limit cycles against the formula of the describing function and long simulations."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import asin, inf, pi, sqrt
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine, cycles, linear, simulate
from dualdrive.cycles.describing import share_of_stiffness, size_for_share
from dualdrive.cycles.flow import Flow
from dualdrive.cycles.orbit import half_range
from dualdrive.motion import step

ARCSEC = pi / 648000


def play_alone(load: str = "550t", damping: float = 0.0, **controller: float) -> Machine:
    """A heavy table on which nothing but the play is nonlinear: no friction, limits, tension."""
    machine = Machine.load(f"heavy-table-{load}")
    for label in list(machine.effects):
        machine.remove(label)
    if damping:
        machine.add("mesh_damping", "meshes", coefficient=damping)
    for limit in ("motors.T_max", "motors.U_max", "motors.omega_max", "controller.Omega_E"):
        machine.set(limit, inf)
    for name, value in {"T_ten": 0.0, **controller}.items():
        machine.set(f"controller.{name}", value)
    return machine


def figure_4(gap: float) -> Machine:
    """The machine of physics §5, Figure 4, with its mesh damping and a current loop of 1000 1/s."""
    machine = play_alone("empty", 2e4, K_v=6, K_i=12, k_p=8e4, T_N=0.1, omega_ci=1000)
    machine.set("meshes.gap", gap)
    return machine


def long_run(machine: Machine, end: float, kick: float = 1e-3) -> tuple[float, float]:
    """Frequency and half range of the table over the last eight seconds."""
    run = simulate(
        machine, step(0.0, end=end), initial={"omega_m": kick}, signals=["theta_m"],
        times=np.linspace(end - 8, end, 160_001), energy=False,
    )  # fmt: skip
    x = run["theta_m"]
    k = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    t = run.t[k] - x[k] * (run.t[k + 1] - run.t[k]) / (x[k + 1] - x[k])
    return (t.size - 1) / (t[-1] - t[0]), half_range(x)


# --------------------------------------------------------------------------- describing function


def by_formula(A: float, gap: float) -> float:
    """Physics §6.6."""
    r = gap / A
    return 1 - 2 / pi * (asin(r) + r * sqrt(1 - r * r))


def G(machine: Machine, s: complex) -> complex:
    """Physics §6.6, for two equal drives of this machine."""
    get = machine.get
    i, i_m, k_p = 150.0, 20.0, get("controller.k_p")
    J, b = i**2 * 0.045 + 60, i**2 * 0.02 + 200
    C_v = k_p * (1 + 1 / (get("controller.T_N") * s)) / (1 + s / get("controller.omega_ci"))
    C_p = get("controller.K_v") + get("controller.K_i") / s
    P = 2 / (get("table.J") * s**2 + get("table.b") * s)
    return complex((1 + i_m**2 * C_v * C_p * P) / (s * (J * s + b + C_v)) + i_m**2 * P)


def test_the_play_s_share_is_the_formula_and_is_undone() -> None:
    for A in (1.01, 1.5, 4.0, 100.0):
        assert share_of_stiffness(A) == pytest.approx(by_formula(A, 1.0), rel=1e-12)
        assert size_for_share(by_formula(A, 1.0)) == pytest.approx(A, rel=1e-9)
    assert share_of_stiffness(1.0) == share_of_stiffness(0.3) == 0


@pytest.mark.parametrize("damping", [0.0, 2e4])
@pytest.mark.parametrize(
    ("load", "law"),
    [("550t", {"K_v": 10.0}), ("empty", {"K_v": 6.0, "K_i": 12.0, "k_p": 8e4})],
)
def test_predictions_satisfy_the_formula(load: str, law: dict[str, float], damping: float) -> None:
    """1 + n (K + c s) G(s) = 0."""
    machine = play_alone(load, damping, **law)
    found = cycles.describing_function(machine)
    assert found
    for cycle in found:
        s = 2j * pi * cycle.frequency_hz
        assert by_formula(cycle.mesh_amplitude, 1.1e-3) == pytest.approx(cycle.n_over_k, rel=1e-9)
        balance = 1 + cycle.n_over_k * (2e7 + damping * s) * G(machine, s)
        assert abs(balance) < 1e-6
        torque = cycle.n_over_k * abs(2e7 + damping * s) * cycle.mesh_amplitude
        table = 20 * 2 * torque / abs(machine.get("table.J") * s**2 + machine.get("table.b") * s)
        assert cycle.amplitude == pytest.approx(table, rel=1e-9)


@pytest.mark.parametrize("damping", [0.0, 2e4])
@pytest.mark.parametrize("K_v", [9.0, 11.0, 13.0, 14.0])
def test_prediction_and_simulation_agree_where_the_share_is_large(
    K_v: float, damping: float
) -> None:
    """Physics §6.6: for N/K >= 0.4 frequency within 7 %, table amplitude within 15 %."""
    machine = play_alone("550t", damping, K_v=K_v)
    (cycle,) = cycles.describing_function(machine)
    assert cycle.n_over_k >= 0.4
    assert cycle.trusted
    assert cycle.stable
    frequency, amplitude = long_run(machine, 120)
    assert cycle.frequency_hz == pytest.approx(frequency, rel=0.07)
    assert cycle.amplitude == pytest.approx(amplitude, rel=0.15)


def test_figure_4_is_beyond_the_method() -> None:
    """Below 0.1 the prediction is useless: 2.1 Hz for 1.55."""
    (cycle,) = cycles.describing_function(figure_4(1.1e-3))
    assert cycle.n_over_k < 0.1
    assert not cycle.trusted


# -------------------------------------------------------------------------------------- shooting


@cache
def swing() -> cycles.Orbit:
    return cycles.shooting(play_alone(K_v=10.0))


def test_an_orbit_is_what_a_long_simulation_ends_in() -> None:
    frequency, amplitude = long_run(play_alone(K_v=10.0), 120)
    assert swing().frequency_hz == pytest.approx(frequency, rel=1e-6)
    assert swing().amplitude == pytest.approx(amplitude, rel=1e-6)
    assert swing().stable


@pytest.mark.parametrize(
    ("gap", "peak_to_peak"), [(0.55e-3, 20.49), (1.1e-3, 40.98), (2.2e-3, 81.97)]
)
def test_amplitude_follows_the_gap_and_frequency_does_not(gap: float, peak_to_peak: float) -> None:
    """Physics §6.3."""
    orbit = cycles.shooting(figure_4(gap))
    assert orbit.frequency_hz == pytest.approx(1.551, abs=5e-4)
    assert orbit.peak_to_peak / ARCSEC == pytest.approx(peak_to_peak, abs=0.01)
    exact = cycles.shooting(figure_4(1e-3), orbit_guess(gap))
    assert orbit.amplitude / gap == pytest.approx(exact.amplitude / 1e-3, rel=1e-7)
    assert orbit.period == pytest.approx(exact.period, rel=1e-9)


def orbit_guess(gap: float) -> cycles.Orbit | str:
    """The describing function's guess leads to the same orbit."""
    return "describing function" if gap > 1e-3 else "simulation"


@pytest.mark.parametrize(("load", "arcsec"), [("250t", 35.0), ("550t", 51.7)])
def test_hunting_without_tension_is_an_attracting_orbit(load: str, arcsec: float) -> None:
    """Physics §5, with dry friction: 34.9 to 35.0 and 51.5 to 51.7 arcsec peak to peak."""
    machine = Machine.load(f"heavy-table-{load}")
    machine.set("controller.T_ten", 0.0)
    orbit = cycles.shooting(machine)
    assert orbit.stable
    assert orbit.peak_to_peak / ARCSEC == pytest.approx(arcsec, abs=0.3)
    assert any(element == "friction of m" for _, element, _, _ in orbit.switches)


def test_multipliers_are_the_decay_of_a_disturbance() -> None:
    """A long simulation returns to the orbit by the largest multiplier each period."""
    orbit = swing()
    assert abs(orbit.along - 1) < 1e-6
    largest = orbit.multipliers[0]
    assert abs(largest.imag) < 1e-9
    start = dict(orbit.state)
    start["omega_m"] *= 1.002
    times = orbit.period * np.arange(40)
    run = simulate(orbit.machine, step(0.0, end=float(times[-1])), initial=start, times=times,
                   signals=["mesh_1.twist"], energy=False)  # fmt: skip
    off = run["mesh_1.twist"] - run["mesh_1.twist"][-1]
    np.testing.assert_allclose(off[7:11] / off[6:10], largest.real, rtol=2e-3)


def test_equal_drives_hide_that_a_cycle_repels() -> None:
    """Figure 4 at K 2: meshes that are nudged apart by 1e-7 rad/s part by 1.162 each period."""
    machine = play_alone("empty", 2e4, K_v=2, K_i=4, k_p=8e4)
    orbit = cycles.shooting(machine)
    assert orbit.frequency_hz == pytest.approx(0.69, abs=0.005)
    assert not orbit.stable
    growth = abs(orbit.multipliers[0])
    start = {**orbit.state, "omega_c1": orbit.state["omega_c1"] + 1e-7}
    times = orbit.period * np.arange(30)
    run = simulate(machine, step(0.0, end=float(times[-1])), initial=start, times=times,
                   signals=["mesh_1.twist", "mesh_2.twist"], energy=False)  # fmt: skip
    apart = run["mesh_1.twist"] - run["mesh_2.twist"]
    np.testing.assert_allclose(apart[21:] / apart[20:-1], growth, rtol=1e-3)


def test_a_closed_flank_without_play_has_the_multipliers_of_its_poles() -> None:
    """A linear machine: exp(pole T) are the eigenvalues of the map over any T."""
    from dualdrive.cycles.flow import Flow

    machine = play_alone(K_v=10.0)
    machine.set("meshes.gap", 0.0)
    flow, T = Flow(machine), 0.05
    M = flow.monodromy(np.zeros(len(flow.states)), T, np.full(len(flow.states), 1e-3))
    found = np.sort(np.abs(np.linalg.eigvals(M)))[::-1]
    right = np.sort(np.exp(linear.poles(machine, modes="(1, 1)").real * T))[::-1]
    np.testing.assert_allclose(found[:10], right[:10], rtol=1e-6)


# -------------------------------------------------------------------------------- curves and maps


def test_hunting_ends_in_a_fold_and_simulation_knows_it() -> None:
    machine = Machine.load("heavy-table-550t")
    machine.set("controller.T_ten", 12.0)
    curve = cycles.branch(cycles.shooting(machine), "controller.T_ten", 16.0, points=7)
    (fold,) = curve.folds
    turn = int(curve.values.argmax())
    assert curve.stable[: turn - 1].all()
    assert not curve.stable[turn + 1 :].any()
    assert fold == pytest.approx(curve.values[turn])
    for tension, hunts in ((fold - 1.0, True), (fold + 1.0, False)):
        machine.set("controller.T_ten", tension)
        start = curve.orbits[turn].state
        run = simulate(machine, step(0.0, end=120.0), initial=start, signals=["theta_m"],
                       times=np.linspace(110, 120, 1001), energy=False)  # fmt: skip
        assert (np.ptp(run["theta_m"]) > 10 * ARCSEC) == hunts


def test_no_step_along_a_curve_goes_along_its_orbits() -> None:
    """The same orbit from another point is no way: what drifted there turned back on itself."""
    machine = Machine.load("heavy-table-550t")
    machine.set("controller.T_ten", 0.0)
    orbits = cycles.branch(cycles.shooting(machine), "controller.T_ten", 20.0, points=4).orbits
    for one, other in pairwise(orbits):
        flow = Flow(one.machine)
        state = np.array(list(one.state.values()))
        size = np.abs(flow.along(state, one.period)).max(0)
        moving = np.array([not name.startswith("controller.") for name in one.state])
        rate = (flow.rate(state, one.period) / size)[moving]
        step = ((np.array(list(other.state.values())) - state) / size)[moving]
        assert abs(rate @ step) < 0.02 * np.linalg.norm(rate) * np.linalg.norm(step)


@pytest.mark.long
def test_however_many_points_a_curve_turns_back_once() -> None:
    machine = Machine.load("heavy-table-550t")
    machine.set("controller.T_ten", 0.0)
    orbit = cycles.shooting(machine)
    curves = [cycles.branch(orbit, "controller.T_ten", 20.0, points=n) for n in (30, 60)]
    for curve in curves:
        assert curve.folds == pytest.approx([13.89], abs=0.03)
        assert (curve.amplitude > 4 * ARCSEC).all()
    lower = [c.values[c.values.argmax() :][::-1] for c in curves]
    periods = [
        np.interp([2.0, 4.0, 8.0], v, (1 / c.frequency_hz)[-v.size :][::-1])
        for v, c in zip(lower, curves, strict=True)
    ]
    np.testing.assert_allclose(periods[0], periods[1], rtol=0.02)


def test_a_map_says_where_there_is_a_cycle_and_why_not() -> None:
    axes = {"controller.T_ten": [0.0, 40.0], "meshes.gap": [0.55e-3, 1.1e-3]}
    found = cycles.survey(Machine.load("heavy-table-550t"), axes, settle=20)
    amplitude = found.grid("amplitude")
    assert amplitude.shape == (2, 2)
    assert amplitude[0, 1] / ARCSEC == pytest.approx(25.9, abs=0.2)
    assert np.ma.getmaskarray(amplitude)[1].all()
    assert "comes to rest" in found.reasons[(1, 0)]
    assert found.to_xarray()["cycle"].values[0].all()


# -------------------------------------------------------------------------------------- refusals


def late() -> Machine:
    machine = play_alone()
    machine.set("controller.delta_t", 5e-3)
    return machine


def unequal() -> Machine:
    machine = play_alone()
    machine.set("motor_2.J", 0.05)
    return machine


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cycles.describing_function(Machine.load("heavy-table-550t")), "T_ten=0, or use"),
        (lambda: cycles.describing_function(Machine.load("linear-axis")), "play in no connection"),
        (lambda: cycles.describing_function(unequal()), "drives differ"),
        (lambda: cycles.shooting(Machine.load("heavy-table-550t")), "comes to rest after a kick"),
        (lambda: cycles.shooting(late()), "slave 5 ms late: shooting needs a machine without"),
        (lambda: cycles.shooting(play_alone(), "guesswork"), "choose simulation, describing"),
        (lambda: cycles.branch(swing(), "controller.K_v", 10.0), "needs two finite numbers"),
        (lambda: cycles.survey(play_alone(), {}), "at least one axis"),
    ],
)
def test_what_has_no_cycle_is_said_so(call: Any, message: str) -> None:
    with pytest.raises(cycles.CycleError, match=message):
        call()
