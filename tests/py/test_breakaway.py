"""A body at rest must not sleep through an input that comes and goes between two steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dualdrive import Machine, _core, parse_motion, simulate

FRICTION, AMPLITUDE, FREQUENCY = 20.0, 60.0, 0.3


def rubbing_axis() -> _core.Machine:
    machine = _core.Machine()
    machine.add_body("table")
    machine.add_motor("motor_1", "table", "direct")
    machine.add_effect("coulomb", "table")
    machine.set("table.J", 95.0)
    machine.set("table.b", 200.0)
    machine.set("coulomb@table.torque", FRICTION)
    return machine


@pytest.mark.parametrize("method", ["adams", "bdf"])
def test_it_breaks_away_whenever_the_torque_exceeds_friction(method: str) -> None:
    drive = _core.sine(AMPLITUDE, FREQUENCY)
    run = _core.simulate(rubbing_axis(), {"T_1": drive}, end=8.0, method=method)
    first = next(event for event in run.events if event[2] == "stuck")
    assert first[0] == pytest.approx(
        math.asin(FRICTION / AMPLITUDE) / (2 * math.pi * FREQUENCY), abs=1e-9
    )
    friction = run.values[:, run.names.index("coulomb@table")]
    assert np.abs(friction).max() <= FRICTION * (1 + 1e-12)


def test_a_short_pulse_in_a_long_rest_is_seen() -> None:
    pulse = _core.sampled(
        [0.0, 50.0, 50.01, 50.02, 100.0], [0.0, 0.0, 400.0, 0.0, 0.0], _core.Interpolation.linear
    )
    run = _core.simulate(rubbing_axis(), {"T_1": pulse}, end=100.0, output_step=1.0)
    assert [event[2:] for event in run.events][:2] == [("stuck", "forward"), ("forward", "stuck")]


@pytest.mark.parametrize("gap", [1.2531328320802006e-05, 2.756892230576441e-05])
def test_a_pinion_that_breaks_away_goes_on(gap: float) -> None:
    """Speed and acceleration are zero then but for rounding, which once told it to stop again."""
    machine = Machine.load("heavy-table-250t")
    machine.set("meshes.gap", gap)
    end = 9.96405499221705
    run = simulate(machine, times=np.linspace(0.0, end, 9965), energy=False)
    assert (run.status, run.message) == ("success", "")
    assert len(run.events) < 100


# ------------------------------------------------------------------- out of a creep, by rounding

ENGINES = ["exact", "explicit"]


def creeping_table(friction: float, stiffness: float) -> _core.Machine:
    machine = _core.Machine()
    machine.add_body("motor_1")
    machine.add_body("table")
    machine.connect("shaft", "motor_1", "table", "compliant")
    machine.add_motor("motor_1", "motor_1", "direct")
    machine.add_effect("coulomb", "table")
    for path, value in {
        "motor_1.J": 1.0,
        "motor_1.b": 40.0,
        "table.J": 10.0,
        "table.b": 40.0,
        "shaft.stiffness": stiffness,
        "coulomb@table.torque": friction,
    }.items():
        machine.set(path, value)
    return machine


@pytest.mark.parametrize("engine", ENGINES)
def test_a_creep_that_ends_at_a_move_ends_once(engine: str) -> None:
    """From 1 s on the motor gives just the friction: speed decays to rounding, until 20 s."""
    for friction in (300.0, 17.3, 1000.0 / 3.0):
        for stiffness in (1.0e4, 1.1e4, 5.0e4):
            for start in (1.2, 1.5):
                torque = [-start * friction, -friction, -friction, -0.5 * friction]
                drive = _core.sampled([0.0, 1.0, 20.0, 21.0], torque, _core.Interpolation.linear)
                run = _core.simulate(creeping_table(friction, stiffness), {"T_1": drive}, end=21.0,
                                     engine=engine, output_step=0.1, energy=False)  # fmt: skip
                assert (run.status, run.message) == ("success", "")
                modes = [event[2:] for event in run.events]
                assert modes[0] == ("stuck", "backward")
                assert modes[-1] == ("backward", "stuck")
                assert len(modes) < 10
                # in between only what rounding makes of a speed of exp(-80 t / 11) and less
                assert all(3.0 < event[0] < 20.1 for event in run.events[1:])
                assert run.values[-1, run.names.index("omega_m")] == 0.0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_creep_without_friction_turns(engine: str) -> None:
    """Where the dry friction is zero there is nothing to stick on, whatever rounding says."""
    for stiffness in (3.0e3, 1.0e4, 1.1e4, 3.0e4, 5.0e4):
        for push in (3.0, 10.0, 17.0):
            torque = [-push, 0.0, 0.0, 0.7 * push]
            drive = _core.sampled([0.0, 1.0, 20.0, 21.0], torque, _core.Interpolation.linear)
            run = _core.simulate(creeping_table(0.0, stiffness), {"T_1": drive}, end=21.0,
                                 engine=engine, output_step=0.1, energy=False)  # fmt: skip
            assert (run.status, run.message) == ("success", "")
            assert run.events[-1][2:] == ("backward", "forward")
            assert len(run.events) < 10


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["heavy-table-dual-servo", "heavy-table-double-pinion"])
def test_a_move_out_of_a_long_rest_is_that_of_cvode(name: str, engine: str) -> None:
    machine = Machine.load(name)
    for dwell in (6.0, 8.0):
        motion = parse_motion(f"cycle:-0.5deg;0deg,v=0.03,a=0.01,j=0.05,dwell={dwell},start=2")
        mine, theirs = (
            simulate(machine, motion, end=6.5 + dwell, engine=e, rtol=1e-11, energy=False,
                     output_step=0.05)
            for e in (engine, "cvode")
        )  # fmt: skip
        assert (mine.status, mine.message) == ("success", "")
        apart = np.abs(mine.values - theirs.values).max(axis=0)
        assert (apart <= 1e-7 * np.abs(theirs.values).max(axis=0)).all()


# ------------------------------------------------------- loose for a moment, by less than rounding


@pytest.mark.parametrize("engine", [*ENGINES, "cvode"])
def test_a_body_that_is_pushed_back_for_a_moment_stops_and_stays(engine: str) -> None:
    """J ω' = r τ − ε − L (1 ± 1) with τ = t − t₀: at rest at τ = 0 and, having gone back, at 2 ε/r.

    It moves forward once r τ = 2 L + ε. Beside the torques that cancel, ε is next to nothing.
    """
    inertia, limit, excess, rate, turn = 2.0, 1.0, 1e-4, 10.0, 0.537
    machine = _core.Machine()
    machine.add_body("table")
    machine.add_motor("motor_1", "table", "direct")
    machine.add_effect("coulomb", "table")
    machine.set("table.J", inertia)
    machine.set("table.b", 0.0)
    machine.set("coulomb@table.torque", limit)
    cancelled = 1e7  # between motor and load
    first = cancelled - limit - excess - rate * turn
    drive = _core.sampled([0.0, 1.0], [first, first + rate], _core.Interpolation.linear)
    speed = ((2.0 * limit + excess) * turn + 0.5 * rate * turn**2) / inertia
    run = _core.simulate(machine, {"T_1": drive, "T_load": _core.constant(cancelled)}, end=1.0,
                         engine=engine, initial={"omega_m": speed}, output_step=0.1,
                         energy=False)  # fmt: skip
    assert (run.status, run.message) == ("success", "")
    assert [event[2:] for event in run.events] == [
        ("forward", "backward"), ("backward", "stuck"), ("stuck", "forward")
    ]  # fmt: skip
    expected = [turn, turn + 2.0 * excess / rate, turn + (2.0 * limit + excess) / rate]
    assert [event[0] for event in run.events] == pytest.approx(expected, abs=5e-6)


def two_that_rub(
    friction: float, on_motor: float, stiffness: float, inertia: float, damping: float
) -> _core.Machine:
    machine = creeping_table(friction, stiffness)
    machine.add_effect("coulomb", "motor_1")
    machine.set("coulomb@motor_1.torque", on_motor)
    machine.set("table.J", inertia)
    machine.set("motor_1.b", damping)
    return machine


@pytest.mark.parametrize(
    ("friction", "on_motor", "stiffness"),
    [(17.3, 1e-3, 5e4), (17.3, 1e-3, 1e5), (100.0, 1e-2, 1e5)],
)
def test_a_motor_that_creeps_against_a_rubbing_table_ends_its_creep_once(
    friction: float, on_motor: float, stiffness: float
) -> None:
    """At 21 s the torque turns while the motor, hardly held, stands still but for rounding."""
    machine = two_that_rub(friction, on_motor, stiffness, inertia=30.0, damping=10.0)
    most = friction + on_motor
    torque = [-1.5 * most, -most, -most, -0.9999 * most, -most, 0.5 * most]
    times = [0.0, 1.0, 20.0, 20.3, 21.0, 22.0]
    drive = _core.sampled(times, torque, _core.Interpolation.linear)
    run = _core.simulate(machine, {"T_1": drive}, end=22.0, output_step=0.1, energy=False)
    assert (run.status, run.message) == ("success", "")
    assert sum(20.9 < event[0] < 21.1 for event in run.events) < 10


def test_a_motor_held_by_next_to_nothing_does_not_end_cvode() -> None:
    """Its slides are so short that the error of the speed ends them where they begin."""
    machine = two_that_rub(300.0, 1e-3, 1e5, inertia=10.0, damping=1.0)
    drive = _core.sampled([0.0, 1.0, 10.0], [-360.0, -300.001, -300.001],
                          _core.Interpolation.linear)  # fmt: skip
    run = _core.simulate(machine, {"T_1": drive}, end=10.0, engine="cvode", output_step=0.1,
                         energy=False)  # fmt: skip
    assert (run.status, run.message) == ("success", "")
