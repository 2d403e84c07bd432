"""A learned curve: its values and slopes, what it reads, how it is written, what it refuses."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.interpolate import CubicHermiteSpline

from core_machines import Array
from dualdrive import Machine, MachineError, _core, simulate
from dualdrive.identify import torque_balance
from dualdrive.traces import Trace
from dualdrive_cli.main import main

VALUES = [3.0, -1.0, 2.0, 2.0, -4.0, 1.0]
LOW, HIGH = -0.5, 2.0


def curve(
    values: list[float] = VALUES, coordinate: str = "in.x", periodic: bool = False
) -> _core.Machine:
    """Return a heavy body on which the curve does nothing to be seen but its torque."""
    machine = _core.Machine()
    machine.add_body("table")
    machine.set("table.J", 1e12)
    machine.add_spline("table", [(coordinate, LOW, HIGH, len(values), periodic)], values)
    return machine


def read(machine: _core.Machine, x: Array, **options: Any) -> Any:
    """Return the run in which the recorded column x goes through these values, 1 s apart."""
    ramp = _core.sampled(np.arange(len(x), dtype=float), x, _core.Interpolation.linear)
    return _core.simulate(
        machine, {"x": ramp}, end=len(x) - 1.0, output_step=1.0, signals=["spline@table"], **options
    )


def torque(machine: _core.Machine, x: Array) -> Array:
    return np.asarray(read(machine, x).values[:, 0])


def by_scipy(x: Array, periodic: bool = False) -> Array:
    """Return the same curve by SciPy's Hermite cubics, with central differences as slopes."""
    values = np.array(VALUES)
    if periodic:
        knots = np.linspace(LOW, HIGH, len(values) + 1)
        step = knots[1] - knots[0]
        slopes = (np.roll(values, -1) - np.roll(values, 1)) / (2 * step)
        closed = CubicHermiteSpline(
            knots, np.append(values, values[0]), np.append(slopes, slopes[0])
        )
        return np.asarray(closed((x - LOW) % (HIGH - LOW) + LOW))
    knots = np.linspace(LOW, HIGH, len(values))
    slopes = np.gradient(values, knots)
    slopes[[0, -1]] = 0.0
    return np.asarray(CubicHermiteSpline(knots, values, slopes)(np.clip(x, LOW, HIGH)))


@pytest.mark.parametrize("periodic", [False, True])
def test_it_is_the_cubic_it_is_said_to_be(periodic: bool) -> None:
    x = np.linspace(-3.0, 5.0, 401)
    np.testing.assert_allclose(
        torque(curve(periodic=periodic), x), by_scipy(x, periodic), atol=1e-12
    )


def test_knots_are_met_and_beyond_them_it_is_constant() -> None:
    knots = np.linspace(LOW, HIGH, len(VALUES))
    np.testing.assert_allclose(torque(curve(), knots), VALUES, atol=1e-14)
    np.testing.assert_allclose(torque(curve(), np.array([-9.0, -1.0, 3.0, 9.0])), [3, 3, 1, 1])


def test_two_knots_make_a_smooth_step() -> None:
    x = LOW + (HIGH - LOW) * np.array([0.25, 0.5, 0.75])
    np.testing.assert_allclose(torque(curve([0.0, 8.0]), x), [1.25, 4.0, 6.75])


def test_a_surface_is_the_product_of_curves() -> None:
    rows, columns = [1.0, -2.0, 0.5], [2.0, 1.0, -1.0, 3.0]
    machine = _core.Machine()
    machine.add_body("table")
    machine.set("table.J", 1e12)
    axes = [("in.x", LOW, HIGH, 3, False), ("in.y", 0.0, 3.0, 4, True)]
    machine.add_spline("table", axes, np.outer(rows, columns).ravel().tolist())
    assert machine.get("spline@table.value_1_3") == pytest.approx(-6.0)
    x = np.linspace(-1.0, 3.0, 81)
    y = np.linspace(-4.0, 4.0, 81)
    t = np.arange(81.0)
    inputs = {n: _core.sampled(t, v, _core.Interpolation.linear) for n, v in (("x", x), ("y", y))}
    run = _core.simulate(machine, inputs, end=80.0, output_step=1.0, signals=["spline@table"])
    one = curve(rows)
    other = _core.Machine()
    other.add_body("table")
    other.set("table.J", 1e12)
    other.add_spline("table", [("in.x", 0.0, 3.0, 4, True)], columns)
    np.testing.assert_allclose(run.values[:, 0], torque(one, x) * torque(other, y), atol=1e-12)


def test_slopes_by_the_knots_are_what_the_knots_have_to_say() -> None:
    """The torque is linear in the values, so its slope by one is the curve with only that one."""
    x = np.linspace(-1.0, 3.0, 41)
    paths = [f"spline@table.value_{k}" for k in range(len(VALUES))]
    slopes = np.asarray(read(curve(), x, sensitivities=paths).sensitivities)[:, 0, :]
    for k in range(len(VALUES)):
        alone = [float(n == k) for n in range(len(VALUES))]
        np.testing.assert_allclose(slopes[:, k], torque(curve(alone), x), atol=1e-9)
    np.testing.assert_allclose(slopes.sum(axis=1), 1.0)


def test_a_curve_over_speed_is_felt_and_differentiated() -> None:
    """Values on a line through zero, far inside their range, are viscous friction."""
    machine = Machine.load("bench")
    knots = np.linspace(-4.0, 4.0, 17)
    machine.add("spline", "table", coordinate="speed", low=-4, high=4, values=-0.3 * knots)
    plain = Machine.load("bench")
    plain.add("viscous", "table", coefficient=0.3)
    options: dict[str, Any] = {"end": 1.0, "rtol": 1e-9, "sensitivities": ["table.J"]}
    one, other = simulate(machine, **options), simulate(plain, **options)
    np.testing.assert_allclose(one["omega_m"], other["omega_m"], atol=1e-6)
    mine, usual = (run.sensitivity("theta_m", "table.J") for run in (one, other))
    np.testing.assert_allclose(mine, usual, atol=1e-5 * np.abs(usual).max())


# --- in machine files -----------------------------------------------------------------------------


def test_it_is_saved_with_its_machine(tmp_path: Path) -> None:
    machine = Machine.load("bench")
    label = machine.add(
        "spline",
        "table",
        coordinate="angle",
        low="-90 deg",
        high="90 deg",
        values=[0, "5 mN*m", 0.01],
    )
    surface = machine.add(
        "spline",
        "pinion_1",
        coordinate=["angle", "in.temperature"],
        low=[0, 20],
        high=["2 rad", 40],
        periodic=[True, False],
        knots=[4, 3],
        size="2 mN*m",
    )
    machine.set(f"{label}.value_2", "7 mN*m")
    machine.set(f"{surface}.value_3_1", 0.25)
    machine.save(tmp_path / "m.toml")
    again = Machine.load(tmp_path / "m.toml")
    assert again.core.effects == machine.core.effects
    for path, value in ((f"{label}.value_1", 0.005), (f"{surface}.value_3_1", 0.25)):
        assert again.get(path) == machine.get(path) == value
    assert again.get(f"{label}.value_2") == 0.007
    assert again.parameter(f"{surface}.value_0_0").typical == 2e-3
    again.set(f"{surface}.value_0_2", 1.5)
    again.save(tmp_path / "n.toml")
    assert Machine.load(tmp_path / "n.toml").get(f"{surface}.value_0_2") == 1.5
    again.remove(label)
    assert Machine.from_toml(again.toml()).effects == again.effects


def test_it_travels() -> None:
    machine = Machine.load("bench")
    machine.add("spline", "table", coordinate="speed", low=-1, high=1, values=[1, 2, 3], size=7)
    machine.set("spline@table.value_1", 9.0)
    for again in (pickle.loads(pickle.dumps(machine)), copy.deepcopy(machine), machine.copy()):
        assert again.core.effects == machine.core.effects
        assert again.get("spline@table.value_1") == 9.0
        assert again.parameter("spline@table.value_1").typical == 7.0


def test_it_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the machine before it, and a curve that was changed to the curve before."""
    monkeypatch.chdir(tmp_path)
    words = ["add", "bench", "spline@table", "--curve", "speed=-4:4:9", "-o", "one.toml"]
    more = ["add", "one.toml", "coulomb@table", "--set", "spline@table.value_4=3", "-o", "two.toml"]
    for line in (words, more):
        assert CliRunner().invoke(main, line).exit_code == 0
    machine = Machine.load("two.toml")
    assert machine.get("spline@table.value_4") == 3.0
    machine.undo()
    assert machine.get("spline@table.value_4") == 0.0
    assert machine.core.effects == Machine.load("one.toml").core.effects
    machine.undo()
    assert machine.effects == Machine.load("bench").effects


def test_the_command_line_adds_a_curve_of_zeros(tmp_path: Path) -> None:
    target = str(tmp_path / "m.toml")
    words = ["add", "bench", "spline@table", "--curve", "speed=-4:4:9", "-o", target]
    done = CliRunner().invoke(main, [*words, "--curve", "angle=0:6.283185:12:periodic"])
    assert done.exit_code == 0, done.output
    machine = Machine.load(target)
    (effect,) = machine.core.effects[-1:]
    assert effect["axes"] == [("speed", -4.0, 4.0, 9, False), ("angle", 0.0, 6.283185, 12, True)]
    assert CliRunner().invoke(main, ["effects", "spline"]).exit_code == 0


CASES: list[tuple[dict[str, Any], str]] = [
    ({"coordinate": "sped"}, "'sped', which this machine doesn't have, did you mean speed"),
    ({"coordinate": "alpha_m"}, "'alpha_m', which this machine doesn't have"),
    ({"coordinate": None}, "coordinate is missing"),
    ({"low": 4.0}, "low = 4 must lie below high = 4"),
    ({"values": [1.0]}, "1 knots; give between 2 and 1000"),
    ({"values": [[1.0, 2.0], [3.0]]}, "every row needs as many numbers"),
    ({"values": [[1.0, 2.0], [3.0, 4.0]]}, "1 coordinates, but values or knots along 2"),
    ({"values": ["1 kg", 2.0]}, "values = '1 kg'"),
    ({"low": "1 kg"}, "low = '1 kg'"),
    ({"size": 0}, "size = 0"),
    ({"periodic": 1}, "periodic = 1: must be true or false"),
    ({"values": None, "knots": 3.5}, "knots = 3.5: must be a whole number"),
    ({"torqe": 1}, "spline@table.torqe = 1: unknown"),
]


@pytest.mark.parametrize(("change", "told"), CASES)
def test_what_makes_no_sense_is_refused_whole(change: dict[str, Any], told: str) -> None:
    machine = Machine.load("bench")
    entry = {"coordinate": "speed", "low": -4.0, "high": 4.0, "values": [0.0, 1.0, 0.0]} | change
    with pytest.raises(MachineError) as error:
        machine.add("spline", "table", **{k: v for k, v in entry.items() if v is not None})
    assert told in str(error.value)
    assert "\n" not in str(error.value)
    assert machine.effects == Machine.load("bench").effects


def test_the_core_alone_refuses_too() -> None:
    machine = curve()
    with pytest.raises(ValueError, match="written by its user; give coordinate"):
        machine.add_effect("spline", "table")
    with pytest.raises(ValueError, match="3 values for 2 knots"):
        machine.add_spline("table", [("t", 0.0, 1.0, 2, False)], [0.0, 0.0, 0.0])
    machine.add_spline("table", [("nothing", 0.0, 1.0, 2, False)], [0.0, 0.0])
    with pytest.raises(ValueError, match="its coordinate 'nothing' is neither a signal"):
        read(machine, np.zeros(2))


# --- learned --------------------------------------------------------------------------------------


def test_the_torque_balance_learns_its_values() -> None:
    """A friction nobody named, by a curve over speed: as the measured torque says, knot by knot."""
    machine = _core.Machine()
    machine.add_body("table")
    machine.add_motor("motor_1", "table", "direct")
    machine.set("table.J", 2.0)
    machine.add_spline("table", [("speed", -1.0, 1.0, 9, False)], [0.0] * 9)
    t = np.arange(0.0, 40.0, 1e-2)
    speed = 0.99 * np.sin(0.8 * t)
    rate = 0.99 * 0.8 * np.cos(0.8 * t)
    angle = -0.99 / 0.8 * np.cos(0.8 * t)
    drag = -0.7 * np.tanh(3.0 * speed) - 0.2 * speed**3
    channels = {"theta_m": angle, "omega_m": speed, "alpha_m": rate, "T_1": 2.0 * rate - drag}
    trace = Trace(t, channels, units={"theta_m": "rad", "omega_m": "rad/s", "alpha_m": "rad/s^2",
                                      "T_1": "N*m"})  # fmt: skip
    paths = [f"spline@table.value_{k}" for k in range(9)]
    fit = torque_balance(machine, trace, free=paths, offsets=False)
    knots = np.linspace(-1.0, 1.0, 9)
    expected = -0.7 * np.tanh(3.0 * knots) - 0.2 * knots**3
    found = np.array([fit.parameters[path].value for path in paths])
    np.testing.assert_allclose(found, expected, atol=0.05)
    assert fit.error < 0.03


def test_a_recorded_column_is_a_coordinate_of_the_balance() -> None:
    machine = curve(coordinate="in.x")
    machine.add_motor("motor_1", "table", "direct")
    x = np.linspace(-1.0, 3.0, 50)
    zero = np.zeros(50)
    channels = {"theta_m": zero, "omega_m": zero, "alpha_m": zero, "T_1": zero, "x": x}
    paths = [f"spline@table.value_{k}" for k in range(len(VALUES))]
    balance = _core.torque_balance(machine, channels, paths, 0.0)
    np.testing.assert_allclose(np.asarray(balance["residual"])[0], -by_scipy(x), atol=1e-12)
    share = -np.asarray(balance["jacobian"])[0]
    np.testing.assert_allclose(share @ np.array(VALUES), by_scipy(x), atol=1e-12)
