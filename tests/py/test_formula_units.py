"""Units in formulas: what people write is turned into the coherent units that a formula needs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dualdrive import Machine, MachineError, simulate
from dualdrive.units import UnitError, coherent, parse
from dualdrive_cli.main import main


@pytest.mark.parametrize(
    ("given", "unit"),
    [
        ("mm", "m"),
        ("mm/s", "m/s"),
        ("um", "m"),
        ("mrad", "rad"),
        ("deg/s", "rad/s"),
        ("rpm", "rad/s"),
        ("kN*m", "N*m"),
        ("Nm", "N*m"),
        ("Nmm*s/deg", "N*m*s/rad"),
        ("N/um", "N/m"),
        ("kN*s/mm", "N*s/m"),
        ("g", "kg"),
        ("ms", "s"),
        ("kHz", "Hz"),
        ("%", ""),
        ("mm/m", ""),
        ("1/ms", "1/s"),
        ("N*s/mm/K", "N*s/m/K"),
        ("N*mm/s^2/deg^2", "N*m/s^2/rad^2"),
    ],
)
def test_the_coherent_unit_of_what_engineers_write(given: str, unit: str) -> None:
    assert coherent(given) == unit


def test_turns_or_one_per_minute_is_asked_for() -> None:
    with pytest.raises(UnitError, match="may mean 1/s or turns per minute"):
        coherent("1/min")


@pytest.mark.parametrize(
    ("given", "value", "unit"),
    [
        ("5 mm/s", 5e-3, "m/s"),
        ("20 deg/s", math.radians(20.0), "rad/s"),
        ({"value": 5, "unit": "mm/s"}, 5e-3, "m/s"),
        ({"value": "0.3 m/min", "unit": "mm/s"}, 5e-3, "m/s"),
        ("3 N*m*s/rad", 3.0, "N*m*s/rad"),
    ],
)
def test_a_parameter_of_a_formula_is_held_in_coherent_units(
    given: object, value: float, unit: str
) -> None:
    machine = Machine.load("linear-axis")
    label = machine.add("expression", "table", formula="bare*c", parameters={"c": given, "bare": 1})
    known = machine.parameter(f"{label}.c")
    assert known.unit == unit
    assert known.value == pytest.approx(value, rel=1e-12)
    again = Machine.from_toml(machine.toml()).parameter(f"{label}.c")
    assert (again.value, again.unit) == (known.value, known.unit)


def test_a_stribeck_velocity_in_mm_per_s_from_the_command_line(tmp_path: Path) -> None:
    formula = "-F*tanh(speed/v0)*exp(-(speed/vs)^2)"
    result = CliRunner().invoke(
        main,
        ["add", "linear-axis", "expression@table", "--formula", formula, "--set", "F=0.2 kN",
         "--set", "v0=100 um/s", "--set", "vs=5 mm/s", "-o", str(tmp_path / "m.toml")],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    machine = Machine.load(tmp_path / "m.toml")
    assert machine.get("expression@table.vs") == pytest.approx(5e-3)
    assert machine.get("expression@table.F") == pytest.approx(200.0)
    machine.set("expression@table.vs", "0.6 m/min")
    assert machine.get("expression@table.vs") == pytest.approx(1e-2)


def test_the_unit_of_a_formula_is_still_checked_after_conversion() -> None:
    machine = Machine.load("linear-axis")
    with pytest.raises(MachineError, match=r"gives N\*m, not a force in N"):
        machine.add("expression", "table", formula="c", parameters={"c": "2 kN*m"})


def test_a_recorded_column_may_be_declared_as_its_recorder_has_it() -> None:
    machine = Machine.load("linear-axis")
    label = machine.add(
        "expression", "table", formula="k*gap", parameters={"k": "2 N/um"}, columns={"gap": "mm"}
    )
    assert dict(machine.core.effects[-1]["columns"]) == {"gap": "m"}
    run = simulate(machine, end=0.1, inputs={"gap": 1e-6})
    np.testing.assert_allclose(run[label], 2.0)


@pytest.mark.parametrize("unit", ["wombat", "1/min", "degC"])
def test_a_unit_that_cannot_be_meant_is_refused_by_name(unit: str) -> None:
    machine = Machine.load("bench")
    with pytest.raises(MachineError, match=rf"parameters\.c.*{unit}"):
        machine.add("expression", "table", formula="0*c", parameters={"c": f"5 {unit}"})


def test_a_temperature_with_its_own_zero_in_a_product_is_refused_in_words() -> None:
    with pytest.raises(UnitError, match="scale with its own zero; write K"):
        parse("5 degC/s", "K/s")
