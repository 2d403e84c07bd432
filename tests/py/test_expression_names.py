"""What a formula may read, and in which units: known when the machine is put together."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine, MachineError, _core, simulate
from dualdrive.replay import play, records
from dualdrive.traces import Trace


def expression(machine: Machine, formula: str, **entry: Any) -> str:
    return machine.add("expression", "table", formula=formula, **entry)


@pytest.mark.parametrize(
    ("formula", "told"),
    [
        ("-0.1 * sped", "reads 'sped', which this machine doesn't have, did you mean speed"),
        ("T_3", "reads 'T_3'"),
        ("table.J * alpha_m", "reads 'alpha_m'"),
        ("energy.stored", "reads 'energy.stored'"),
        ("temperature", "a recorded column is declared: columns = { temperature = 'its unit' }"),
    ],
)
def test_an_unknown_name_is_refused_where_it_is_written(formula: str, told: str) -> None:
    machine = Machine.load("bench")
    with pytest.raises(MachineError) as error:
        expression(machine, formula.replace("table.J * ", ""))
    assert told in str(error.value)
    assert "expression@table" not in machine.effects


def test_a_declared_column_is_read_checked_and_kept(tmp_path: Path) -> None:
    machine = Machine.load("bench")
    columns = {"warmth": "K", "wind": "m/s"}
    with pytest.raises(MachineError, match=r"gives K, not a torque in N\*m"):
        expression(machine, "warmth", columns=columns)
    label = expression(machine, "c * warmth", parameters={"c": "2 N*m/K"}, columns=columns)
    machine.save(tmp_path / "m.toml")
    for again in (Machine.load(tmp_path / "m.toml"), copy.deepcopy(machine),
                  pickle.loads(pickle.dumps(machine))):  # fmt: skip
        assert again.core.effects == machine.core.effects
        assert dict(again.core.effects[-1]["columns"]) == columns
    run = simulate(Machine.load(tmp_path / "m.toml"), end=0.1, inputs={"warmth": 0.5})
    np.testing.assert_allclose(run[label], 1.0)


def test_a_column_without_a_unit_may_be_read_by_its_full_name() -> None:
    machine = Machine.load("bench")
    expression(machine, "c * in.push", parameters={"c": "2 N*m"})
    run = simulate(machine, end=0.1, inputs={"push": 0.25})
    np.testing.assert_allclose(run["expression@table"], 0.5)


def test_a_trace_may_have_other_columns_than_those_a_law_reads() -> None:
    machine = Machine.load("bench")
    expression(machine, "c * in.push", parameters={"c": "2 N*m"})
    t = np.linspace(0.0, 0.5, 51)
    zero = np.zeros(51)
    motion = 0.01 * np.sin(6.0 * t)
    channels = {"theta_ref": motion, "theta_m": motion, "push": zero, "coolant": zero}
    trace = Trace(t, channels, units={"theta_ref": "rad", "theta_m": "rad"})
    (record,) = records(machine, {"one": trace})
    assert set(record.inputs) == {"theta_ref", "push"}
    assert play(machine.core, record).ok


def test_units_are_checked_on_a_linear_axis_too() -> None:
    machine = Machine.load("linear-axis")
    assert machine.axis == "linear"
    with pytest.raises(MachineError, match=r"gives .*, not a force in N"):
        expression(machine, "c * t", parameters={"c": "2 N/m"})
    with pytest.raises(MachineError, match=r"gives N\*m, not a force in N"):
        expression(machine, "c * angle", parameters={"c": "2 N"})
    label = expression(machine, "-c * speed", parameters={"c": "2 N*s/m"})
    assert machine.get(f"{label}.c") == 2.0


def test_formulas_stay_differentiable_by_what_columns_do() -> None:
    machine = Machine.load("bench")
    label = expression(machine, "c * in.push", parameters={"c": "0.01 N*m"})
    path = f"{label}.c"
    ramp = _core.ramp(1.0, 0.5)
    options: dict[str, Any] = {"end": 0.5, "inputs": {"push": ramp}, "rtol": 1e-10}
    slope = simulate(machine, sensitivities=[path], **options).sensitivity("omega_m", path)
    runs = []
    for value in (0.0101, 0.0099):
        machine.set(path, value)
        runs.append(simulate(machine, **options)["omega_m"])
    difference = (runs[0] - runs[1]) / 2e-4
    np.testing.assert_allclose(slope, difference, atol=1e-4 * np.abs(difference).max())
