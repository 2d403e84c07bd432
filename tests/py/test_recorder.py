"""Effects at the name of a recorded channel: what simulate and replay write down of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine, MachineError, _core
from dualdrive.motion import move
from dualdrive.recorder import own_paths
from dualdrive.replay import named, play_all, records
from dualdrive.simulation import simulate
from dualdrive.traces import Trace

QUICK = move(0.3, v=1.5, a=5.0, j=50.0, end=0.4)


def run(*effects: tuple[str, str, dict[str, float]], **options: Any) -> Any:
    machine = Machine.load("bench")
    for effect, place, numbers in effects:
        machine.add(effect, place, **numbers)
    return simulate(machine, QUICK, **options)


PLAIN = run()


def test_counts_are_whole_and_nearest() -> None:
    step = 1e-4
    seen = run(("quantisation", "theta_m", {"step": step}))
    counts = seen["theta_m"] / step
    assert np.abs(counts - np.round(counts)).max() < 1e-6
    assert np.abs(seen["theta_m"] - PLAIN["theta_m"]).max() <= step / 2 * (1 + 1e-9)
    assert seen["theta_1"].tobytes() == PLAIN["theta_1"].tobytes()  # and nothing else moves
    assert seen["e"].tobytes() == PLAIN["e"].tobytes()


def test_an_eccentric_disc_errs_once_per_turn() -> None:
    seen = run(("encoder_eccentricity", "theta_1", {"amplitude": 2e-3, "phase": 0.5}))
    expected = PLAIN["theta_1"] + 2e-3 * np.cos(PLAIN["theta_1"] + 0.5)
    np.testing.assert_allclose(seen["theta_1"], expected, rtol=0, atol=1e-15)
    assert PLAIN["theta_1"].max() > 2 * np.pi  # a turn at least


def test_a_late_recorder_writes_what_was() -> None:
    seen = run(("sensor_delay", "theta_1", {"time": 5e-3}))
    assert seen["theta_1"][:6] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(seen["theta_1"][5:], PLAIN["theta_1"][:-5], atol=1e-9)
    assert (seen.t == PLAIN.t).all()
    assert seen.modes.shape[0] == seen.work.shape[0] == len(seen.t)


def test_one_after_another_in_their_order() -> None:
    seen = run(
        ("sensor_offset", "I_1", {"value": 0.013}),
        ("quantisation", "I_1", {"step": 0.01}),
        signals=["I_1", "e"],
    )
    np.testing.assert_allclose(seen["I_1"], 0.01 * np.round((PLAIN["I_1"] + 0.013) / 0.01))


def test_slopes_by_the_machine_and_by_the_recorder() -> None:
    effects = [
        ("sensor_delay", "theta_1", {"time": 5.3e-3}),
        ("encoder_eccentricity", "theta_1", {"amplitude": 2e-3, "phase": 0.5}),
        ("sensor_offset", "theta_1", {"value": 1e-3}),
    ]
    paths = {
        "sensor_delay@theta_1.time": 1e-5,
        "table.J": 1e-4,
        "encoder_eccentricity@theta_1.amplitude": 1e-5,
        "encoder_eccentricity@theta_1.phase": 1e-4,
        "sensor_offset@theta_1.value": 1e-5,
    }
    base = run(*effects, sensitivities=list(paths))
    assert base.parameters == tuple(paths)
    for path, h in paths.items():
        ends = []
        for sign in (1, -1):
            machine = base.machine.copy()
            machine.set(path, machine.get(path) + sign * h)
            ends.append(simulate(machine, QUICK)["theta_1"])
        difference = (ends[0] - ends[1]) / (2 * h)
        error = np.abs(base.sensitivity("theta_1", path) - difference)
        assert error.max() < 2e-3 * np.abs(difference).max(), path


def test_no_gradient_backwards_through_a_recorder() -> None:
    with pytest.raises(MachineError, match="ask for sensitivities"):
        run(("quantisation", "theta_m", {"step": 1e-4}), gradient=["table.J"])


def test_a_replay_reads_as_simulate_does() -> None:
    machine = Machine.load("bench")
    machine.add("encoder_eccentricity", "theta_m", amplitude=1e-3, phase=np.pi / 2)
    machine.add("sensor_delay", "theta_1", time=2e-3)
    machine.add("quantisation", "I_2", step=0.01)
    seen = simulate(machine, QUICK)
    names = ("theta_ref", "theta_m", "theta_1", "I_2")
    trace = Trace(np.array(seen.t), {name: np.array(seen[name]) for name in names}, name="made")
    (played,) = play_all(machine.core, records(machine, named(trace), motion=QUICK))
    assert played.ok
    for name in ("theta_m", "theta_1"):
        np.testing.assert_allclose(played.simulated[name], seen[name], atol=1e-7)
    counts = np.abs(played.simulated["I_2"] - seen["I_2"]) / 0.01
    assert (counts > 0.5).mean() < 0.02  # a count apart where the signal stands at its edge
    # the following error is made of channels, so it has the disc's error too
    assert np.abs(played.residual("e")).max() < 1e-7


def replay(machine: Machine, seen: Any, paths: Sequence[str] = ()) -> Any:
    names = ("theta_ref", "theta_m", "theta_1", "I_1")
    trace = Trace(np.array(seen.t), {name: np.array(seen[name]) for name in names}, name="made")
    played_from = records(machine, named(trace), motion=QUICK, start="rest")
    (played,) = play_all(machine.core, played_from, paths)
    assert played.ok
    return played


def test_a_record_shows_what_the_sensor_read() -> None:
    machine = Machine.load("bench")
    machine.add("sensor_delay", "table", time=4e-3)
    machine.add("encoder_eccentricity", "motors", amplitude=2e-3, phase=np.pi / 2)
    machine.add("sensor_delay", "theta_m", time=2e-3)  # and the recorder is later than that
    seen = simulate(machine, QUICK)
    played = replay(machine, seen)
    late = np.concatenate([[0.0, 0.0], seen["sensed.table"][:-2]])
    np.testing.assert_allclose(played.simulated["theta_m"], late, atol=1e-6)
    eccentric = seen["theta_1"] + 2e-3 * np.cos(seen["theta_1"] + np.pi / 2)
    np.testing.assert_allclose(played.simulated["theta_1"], eccentric, atol=1e-6)
    # simulate tells them apart: its theta_m is the table's own, 2 ms late, 2 ms before the sensor's
    assert np.abs(seen["theta_m"] - seen["sensed.table"]).max() > 1e-3


def test_slopes_of_what_the_sensor_read() -> None:
    paths = {
        "sensor_delay@table.time": 1e-5,
        "encoder_eccentricity@motors.amplitude": 1e-5,
        "sensor_offset@theta_m.value": 1e-4,
        "table.J": 1e-4,
    }
    machine = Machine.load("bench")
    machine.add("sensor_delay", "table", time=4.3e-3)
    machine.add("encoder_eccentricity", "motors", amplitude=2e-3, phase=np.pi / 2)
    machine.add("sensor_offset", "theta_m", value=0.1)
    seen = simulate(machine, QUICK)
    base = replay(machine, seen, list(paths))
    for k, (path, h) in enumerate(paths.items()):
        ends = []
        for sign in (1, -1):
            moved = machine.copy()
            moved.set(path, moved.get(path) + sign * h)
            ends.append(replay(moved, seen).simulated)
        for name in ("theta_m", "theta_1", "I_1"):
            difference = (ends[0][name] - ends[1][name]) / (2 * h)
            error = np.abs(base.slopes[name][:, k] - difference).max()
            assert error < 3e-3 * np.abs(difference).max() + 1e-6, (path, name)


def test_whose_paths_are_a_recorders() -> None:
    machine = Machine.load("bench")
    machine.add("sensor_offset", "theta_m")
    machine.add("sensor_offset", "table")
    paths = ["sensor_offset@table.value", "sensor_offset@theta_m.value", "table.J"]
    assert own_paths(machine.core, paths) == ["sensor_offset@theta_m.value"]
    assert _core.recorded_channels(machine.core) == ["theta_m"]


def test_a_balance_has_no_sensors() -> None:
    machine = Machine.load("bench")
    machine.add("sensor_offset", "theta_m")
    rows = {name: np.zeros(3) for name in ("theta_m", "omega_m", "alpha_m", "T_1", "T_2")}
    with pytest.raises(ValueError, match="fit it in the closed loop"):
        _core.torque_balance(machine.core, rows, ["sensor_offset@theta_m.value"])
