"""The exact engine where it is delicate: surfaces, ties, rounding of times, late hours, refusals.

The oracle tests run with it wherever they name no engine; benchmarks/campaign.py runs it on random
machines, of which twenty are examined here.
"""

from __future__ import annotations

import os
import subprocess
import sys
from math import asin, exp, pi, sqrt
from pathlib import Path

import numpy as np
import pytest

import core_machines
from core_machines import Run, add_friction, core_inputs, core_machine, set_all
from dualdrive import Machine, _core
from dualdrive.simulation import simulate
from reference_model import heavy_table, move

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import campaign
from affine_machines import AffineMachine

PRECISIONS = (False, True)  # long_double
MOTION = move(0.02, 0.03, 0.05, 0.3, start=0.05)


def run(machine: _core.Machine, end: float, *, long_double: bool = False, **options: object) -> Run:
    options = {"engine": "exact", "energy": False, "inputs": {}} | options
    trajectory = _core.simulate(machine, end=end, long_double=long_double, **options)  # type: ignore[arg-type]
    assert trajectory.status == "success", trajectory.message
    return Run(trajectory)


def table(J: float = 2.0, **values: float) -> _core.Machine:
    machine = _core.Machine()
    machine.add_body("table")
    set_all(machine, "table", {"J": J} | values)
    return machine


def between_flanks(K: float = 1e6, gap: float = 1e-3, J: float = 1.0) -> _core.Machine:
    """Return a pinion that moves freely in the gap of a locked table."""
    machine = _core.Machine()
    machine.add_body("pinion_1")
    machine.add_body("table", locked=True)
    machine.connect("mesh_1", "pinion_1", "table", "gap", "driver")
    machine.set("pinion_1.J", J)
    set_all(machine, "mesh_1", {"stiffness": K, "gap": gap})
    return machine


# ------------------------------------------------------------------------------ on a surface


@pytest.mark.parametrize("long_double", PRECISIONS)
@pytest.mark.parametrize("side", [1, -1])
def test_a_start_on_a_flank_with_a_speed_into_it(side: int, long_double: bool) -> None:
    K, J, gap, speed = 1e6, 1.0, 1e-3, 0.1
    start = {"mesh_1.twist": side * gap, "omega_c1": side * speed}
    bounce = run(between_flanks(K, gap, J), 0.05, initial=start, long_double=long_double)
    contact, flight = pi * sqrt(J / K), 2 * gap / speed
    times = [t for t, *_ in bounce.contacts]
    made = (contact + flight) * np.arange(3)
    np.testing.assert_allclose(times, np.sort([*made, *(made + contact)])[: len(times)], atol=1e-14)
    assert len(times) == 6
    assert bounce.contacts[0][3] == side


@pytest.mark.parametrize("long_double", PRECISIONS)
def test_a_start_on_a_flank_with_a_speed_out_of_it(long_double: bool) -> None:
    start = {"mesh_1.twist": 1e-3, "omega_c1": -0.1}
    flight = run(between_flanks(), 0.015, initial=start, long_double=long_double)
    assert flight.contacts == []
    np.testing.assert_allclose(flight["mesh_1.twist"], 1e-3 - 0.1 * flight.t, atol=1e-16)


def test_a_start_at_rest_on_a_flank_stays() -> None:
    assert run(between_flanks(), 1.0, initial={"mesh_1.twist": 1e-3}).raw.events == []


# ----------------------------------------------------------------------------------- grazing


@pytest.mark.parametrize("long_double", PRECISIONS)
@pytest.mark.parametrize(("beyond", "contacts"), [(1e-11, 0), (-1e-11, 40)])
def test_contacts_of_a_microsecond_are_all_seen(
    beyond: float, contacts: int, long_double: bool
) -> None:
    """A pinion on a spring swings 1 mrad at 1 Hz in a gap 1e-11 of it wider or narrower."""
    machine = between_flanks(gap=1e-3 * (1 + beyond))
    machine.add_body("frame", locked=True)
    machine.connect("spring_1", "pinion_1", "frame", "compliant", "driver")
    machine.set("spring_1.stiffness", (2 * pi) ** 2)
    start = {"mesh_1.twist": 0.5e-3, "spring_1.twist": 0.5e-3, "omega_c1": 2e-3 * pi * sqrt(0.75)}
    swing = run(machine, 10.0, initial=start, long_double=long_double)
    assert len(swing.contacts) == contacts
    if contacts:  # x = 1e-3 (1 − (2π t)²/2) near its top
        made, left = (np.array([t for t, _, a, _ in swing.contacts if (a == 0) == new])
                      for new in (True, False))  # fmt: skip
        np.testing.assert_allclose(left - made, 2 * sqrt(2 * -beyond) / (2 * pi), rtol=0.02)
        np.testing.assert_allclose(np.diff(made), 0.5, atol=2e-6)


# -------------------------------------------------------------------------------------- ties


@pytest.mark.parametrize("long_double", PRECISIONS)
def test_flanks_that_meet_at_one_instant(long_double: bool) -> None:
    """Three pinions alike, alike started: every switch happens three times, at one time."""
    machine = _core.Machine()
    machine.add_body("table", locked=True)
    for n in (1, 2, 3):
        machine.add_body(f"pinion_{n}")
        machine.connect(f"mesh_{n}", f"pinion_{n}", "table", "gap", "driver")
        machine.set(f"pinion_{n}.J", 1.0)
        set_all(machine, f"mesh_{n}", {"stiffness": 1e6, "gap": 1e-3})
    start = {f"omega_c{n}": 0.1 for n in (1, 2, 3)}
    seen = run(machine, 0.2, initial=start, long_double=long_double)
    period = 2 * 1e-3 / 0.1 + pi * 1e-3
    assert len(seen.contacts) == 3 * 2 * 9  # made at 10 ms + k periods
    assert 0.01 + 8 * period < 0.2 < 0.01 + 9 * period
    for k in range(0, len(seen.contacts), 3):
        tied = seen.contacts[k : k + 3]
        assert len({c[0] for c in tied}) == 1
        assert {c[1] for c in tied} == {1, 2, 3}
        assert len({c[2:] for c in tied}) == 1


# --------------------------------------------------------------------------------- ever faster


@pytest.mark.parametrize("long_double", PRECISIONS)
def test_a_pinion_that_is_pressed_bounces_to_rest(long_double: bool) -> None:
    """Impacts follow each other ever faster; the pinion ends where the spring bears the torque."""
    K, J, torque, gap = 1e6, 1.0, 5.0, 1e-3
    machine = between_flanks(K, gap, J)
    machine.set(f"{machine.add_effect('mesh_damping', 'mesh_1')}.coefficient", 0.2 * sqrt(K * J))
    machine.add_expression("pinion_1", "a", [("a", "N*m", torque)])
    seen = run(machine, 1.0, long_double=long_double)
    made = np.array([t for t, _, before, _ in seen.contacts if before == 0])
    assert made[0] == pytest.approx(sqrt(2 * gap * J / torque), rel=1e-13)
    flights = np.diff(made)
    assert len(made) > 4
    assert (np.diff(flights) < 0).all()
    assert seen["mesh_1.twist"][-1] == pytest.approx(gap + torque / K, rel=1e-12)
    assert abs(seen["omega_c1"][-1]) < 1e-12
    assert seen.contacts[-1][3] == 1


# ----------------------------------------------------------------- times that rounding separates


@pytest.mark.parametrize("engine", ["exact", "explicit", "cvode"])
def test_a_step_of_the_command_on_a_tick_is_seen_by_that_tick(engine: str) -> None:
    """The 300th tick of 0.5 ms is at 0.15 s; 3 × 0.05 s is 2.8e-17 s later."""
    machine = core_machine(heavy_table())
    for loop in ("position", "speed"):
        machine.set(f"controller.{loop}_sample", 5e-4)
    on, beside, late = 0.15, 3 * 0.05, 0.15 + 1e-7
    assert on < beside

    def command(at: float) -> Run:
        return run(machine, 0.17, engine=engine, inputs={"theta_ref": _core.step(1e-4, at)},
                   rtol=1e-12)  # fmt: skip

    here, there, next_tick = (command(at)["T_1*"] for at in (on, beside, late))
    size = np.abs(here).max()
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-9 * size)
    assert np.abs(next_tick - here).max() > 1e-2 * size


def test_a_smooth_knot_beside_a_break_changes_the_piece() -> None:
    """A spline's knot at 3 × 0.1 s, a jump of the load at 0.3 s: the load is over first."""
    machine = table(b=3.0)
    machine.add_expression("table", "a * in.push", [("a", "N*m", 1.0)])
    t = 0.1 * np.arange(7)
    inputs = {
        "push": _core.sampled(t, np.sin(5 * t), _core.Interpolation.cubic),
        "T_load": _core.step(0.5, 0.3),
    }
    assert t[3] > 0.3
    coarse, fine = (run(machine, 0.6, inputs=inputs, output_step=h) for h in (0.1, 1e-3))
    np.testing.assert_allclose(coarse["omega_m"], fine["omega_m"][::100], rtol=0, atol=1e-14)


@pytest.mark.parametrize("long_double", PRECISIONS)
@pytest.mark.parametrize("start", [0.0, 3600.0])
def test_breaking_loose_under_a_sine_is_one_switch_each_time(
    start: float, long_double: bool
) -> None:
    """Late in the day too, when a rounded time is far from the switch in units of the load."""
    level, load, hertz = 1.0, 1.001, 1.7
    machine = table(b=50.0)
    add_friction(machine, "table", (level, level))
    inputs = {"T_load": _core.sine(load, hertz, phase=-2 * pi * hertz * start)}
    seen = run(machine, start + 20.0, start=start, inputs=inputs, long_double=long_double)
    log = seen.events("friction of m")
    loose = [t - start for t, before, _ in log if before == "stuck"]
    assert len(log) == 2 * len(loose)
    first = asin(level / load) / (2 * pi * hertz)
    expected = first + np.arange(len(loose)) / (2 * hertz)
    assert len(loose) == round(20 * 2 * hertz)
    np.testing.assert_allclose(loose, expected, rtol=0, atol=1e-12 * max(1.0, start) * 10)


@pytest.mark.parametrize("output_step", [1e-3, 7.3e-4, 2.5e-4])
def test_sampled_loops_with_latency_on_any_grid(output_step: float) -> None:
    machine = core_machine(heavy_table())
    for loop, period in (("position", 2e-3), ("tension", 1e-3), ("speed", 5e-4)):
        machine.set(f"controller.{loop}_sample", period)
        machine.set(f"controller.{loop}_latency", 0.37 * period)
    inputs = core_inputs(MOTION)
    times = np.linspace(0.0, 0.5, 51)
    truth = run(machine, 0.5, engine="cvode", rtol=1e-13, inputs=inputs, times=times.tolist())
    seen = run(machine, 0.5, inputs=inputs, output_step=output_step)
    assert len(truth.raw.events) > 3
    assert [e[1:] for e in seen.raw.events] == [e[1:] for e in truth.raw.events]
    apart = [a[0] - b[0] for a, b in zip(seen.raw.events, truth.raw.events, strict=True)]
    assert np.abs(apart).max() < 1e-8
    last = run(machine, 0.5, inputs=inputs, times=times.tolist())
    for name in ("theta_m", "omega_m", "I_1", "I_2", "T_1*"):
        peak = np.abs(truth[name]).max()
        np.testing.assert_allclose(last[name], truth[name], rtol=0, atol=1e-7 * peak)


# ----------------------------------------------------------------------------------- formulas


def test_formulas_that_are_affine_between_switches_are_solved() -> None:
    J, c, start = 2.0, 3.0, 0.5
    machine = table(J)
    machine.add_expression("table", "-c * max(speed, 0)", [("c", "N*m*s/rad", c)])
    slower = run(machine, 2.0, initial={"omega_m": start})
    np.testing.assert_allclose(slower["omega_m"], start * np.exp(-c / J * slower.t), rtol=1e-13)
    free = run(machine, 2.0, initial={"omega_m": -start})
    np.testing.assert_allclose(free["omega_m"], -start, rtol=1e-15)
    assert core_machines.run(machine, end=0.1).raw.statistics["method"] == "exact"
    assert slower["omega_m"][-1] == pytest.approx(start * exp(-c / J * 2.0), rel=1e-13)


@pytest.mark.parametrize(
    "formula", ["-c * speed * abs(speed)", "-c * sin(angle)", "c * t", "c * tanh(speed)"]
)
def test_formulas_that_are_not_are_refused_by_name(formula: str) -> None:
    machine = table()
    machine.add_expression("table", formula, [("c", "", 1.0)])
    with pytest.raises(ValueError, match=r"engine = exact: effect expression@table is not affine"):
        run(machine, 1.0)
    assert core_machines.run(machine, end=0.01).raw.statistics["method"] != "exact"


# ----------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("effect", "place"),
    [("stribeck", "table"), ("lugre", "pinion_2"), ("cogging", "motor_1"),
     ("torque_ripple", "motor_2"), ("eccentricity", "pinion_1")],
)  # fmt: skip
def test_other_effects_are_refused_by_name(effect: str, place: str) -> None:
    machine = core_machine(heavy_table())
    label = machine.add_effect(effect, place)
    with pytest.raises(ValueError, match=rf"exact: effect {label} is not affine.*engine = auto"):
        run(machine, 1.0, inputs=core_inputs(MOTION))


def test_delays_are_refused_by_name() -> None:
    machine = core_machine(heavy_table())
    machine.set("controller.delta_t", 1e-3)
    with pytest.raises(ValueError, match=r"exact: controller.delta_t delays a signal"):
        run(machine, 1.0, inputs=core_inputs(MOTION))


def test_reference_runs_have_no_derivatives() -> None:
    with pytest.raises(ValueError, match=r"long_double = true: .* no derivatives"):
        run(table(), 1.0, long_double=True, sensitivities=["table.J"])


@pytest.mark.parametrize(("name", "taken"), [("baseline", True), ("avx1024", False), ("", True)])
def test_kernels_are_named_in_the_environment(name: str, taken: bool) -> None:
    code = "from dualdrive import _core; print(_core.__kernels__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False,
                          env=os.environ | {"DUALDRIVE_KERNELS": name})  # fmt: skip
    assert (done.returncode == 0) is taken
    if name:
        assert name in done.stdout + done.stderr
    if not taken:
        assert "DUALDRIVE_KERNELS = avx1024 is none of what this processor runs" in done.stderr


# ------------------------------------------------------------------------------ random machines


def test_twenty_machines_of_the_campaign() -> None:
    """Every switch of the run in double is that of long double on a finer grid."""
    seen = [campaign.examine(seed, seed == 0, budget=2500) for seed in range(20)]
    assert [r["seed"] for r in seen if r["verdict"] == "FAILED"] == []
    assert sum(r["verdict"] == "agree" for r in seen) >= 17
    assert sum(r["switches"] for r in seen) > 1500
    distance, moved = seen[0]["cvode"]["apart"], seen[0]["cvode"]["itself"]
    assert distance[2] < distance[1] < distance[0]
    assert distance[2] <= 3 * moved[1]


@pytest.mark.parametrize("seed", [265, 549])
def test_machines_that_would_not_settle(seed: int) -> None:
    """A tension's kink of a size no rule knew; a drive that leaves its limit with no rate."""
    case = AffineMachine(seed)
    assert campaign.run(case, engine="exact").status == "success"


@pytest.mark.parametrize("J", [1e-9, 1e-12])
def test_what_dies_away_in_picoseconds_is_left_to_bdf(J: float) -> None:
    """No inertia on a bearing with friction: billions of exact steps, some thousand of BDF."""
    machine = Machine.load("bench")
    machine.set("table.J", J)
    found = simulate(machine, end=1.0)
    assert found.status == "success", found.message
    assert found.statistics["method"] == "bdf"
    assert found.statistics["steps"] < 20_000
    machine.set("table.J", 1e-6)  # nothing hangs on it any more
    usual = simulate(machine, end=1.0)
    assert usual.statistics["method"] == "exact"
    near = 1e-5 * float(np.ptp(usual["theta_m"]))
    assert found["theta_m"][-1] == pytest.approx(usual["theta_m"][-1], abs=near)
