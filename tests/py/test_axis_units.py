"""In which unit a number of a machine is shown: rad and N*m, or m and N on a linear axis."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from dualdrive import Machine, _core
from dualdrive.describe import meaning, scale_on, spoken_on, unit_on
from dualdrive.diagnose import diagnose
from dualdrive.diagnose.balance_findings import _stuck
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.machine_file.frames import linear_unit
from dualdrive.report import page
from dualdrive_cli._diagnosis import show
from dualdrive_cli.main import main
from measured import emps, measured_file

EMPS = Path(__file__).resolve().parents[2] / "examples" / "emps.toml"


@pytest.mark.parametrize(
    ("rotary", "linear"),
    [
        ("N*m", "N"),
        ("kg*m^2", "kg"),
        ("rad", "m"),
        ("rad/s", "m/s"),
        ("rad/s^3", "m/s^3"),
        ("N*m/rad", "N/m"),
        ("N*m*s/rad", "N*s/m"),
        ("N*m*s^2/rad^2", "N*s^2/m^2"),
        ("N*m/K", "N/K"),
        ("V*s/rad", "V*s/m"),
        ("1/rad", "1/m"),
        ("s", "s"),
        ("", ""),
        ("kg", "kg"),
        ("N*m^2", "N*m^2"),
    ],
)
def test_the_linear_unit_of_a_rotary_one(rotary: str, linear: str) -> None:
    assert linear_unit(rotary) == linear


@pytest.mark.parametrize(
    ("what", "unit"),
    [
        ("table.J", "kg"),
        ("table.b", "N*s/m"),
        ("motors.J", "kg"),
        ("T_1", "N"),
        ("theta_m", "m"),
        ("omega_ref", "m/s"),
        ("e", "m"),
        ("I_1", "A"),
        ("N*m", "N"),
        ("kg*m^2", "kg"),
        ("rad/s", "m/s"),
    ],
)
def test_an_axis_driven_directly_is_linear_throughout(what: str, unit: str) -> None:
    assert unit_on(Machine.load(EMPS), what) == unit


def test_a_candidate_that_the_machine_has_not_got() -> None:
    emps, bench = Machine.load(EMPS), Machine.load("bench")
    assert unit_on(emps, "coulomb@table.torque", "N*m") == "N"
    assert unit_on(emps, "coulomb@motors.torque", "N*m") == "N"
    assert unit_on(bench, "coulomb@table.torque", "N*m") == "N*m"


def test_motors_before_a_pinion_stay_rotary() -> None:
    """A rack: the drives turn, the table slides."""
    text = 'schema = 1\nbase = "bench"\naxis = "linear"\n'
    rack = Machine.from_toml(text)
    assert unit_on(rack, "T_1") == "N*m"
    assert unit_on(rack, "motor_1.J") == "kg*m^2"
    assert unit_on(rack, "table.J") == "kg"
    assert unit_on(rack, "T_load") == "N"
    assert unit_on(rack, "N*m") == "N"


def test_a_bare_core_is_rotary() -> None:
    assert unit_on(_core.Machine(), "N*m") == "N*m"


def test_values_are_spoken_in_the_units_of_the_axis() -> None:
    emps, bench = Machine.load(EMPS), Machine.load("bench")
    assert spoken_on(emps, 20.13, "N*m") == "20.13 N"
    assert spoken_on(emps, 5e-3, "rad/s") == "5 mm/s"
    assert spoken_on(bench, 20.13, "N*m") == "20.13 N·m"
    assert spoken_on(bench, 1e-4, "theta_m") == "20.63 arcsec"
    column = scale_on(emps, "omega_m", [1e-3, 5e-3])
    assert column.unit == "mm/s"
    assert column.factor == pytest.approx(1e-3)
    assert column([5e-3]) == pytest.approx([5.0])


def test_words_follow_the_unit() -> None:
    emps, bench = Machine.load(EMPS), Machine.load("bench")
    assert meaning(emps, emps.parameter("table.J")) == "mass in the body's own frame"
    assert meaning(bench, bench.parameter("table.J")).startswith("moment of inertia")
    shown = CliRunner().invoke(main, ["machine", "show", str(EMPS)]).output
    assert "N*m" not in shown.replace("N*m*s", "")
    assert "rad" not in shown
    assert "torque" not in "".join(line for line in shown.splitlines() if " N " in line)


def test_a_balance_of_a_linear_axis_is_told_in_newtons() -> None:
    record = measured_file("emps/DATA_EMPS.mat")
    mapping = EMPS.with_name("emps.map.toml")
    common = [str(EMPS), str(record), "--map", str(mapping), "--mode", "balance"]
    told = CliRunner().invoke(main, ["compare", *common]).output
    assert re.search(r"equation +38\.7\d% .* 20\.91 N\b", told)
    with TemporaryDirectory() as folder:
        fitted = CliRunner().invoke(main, ["fit", *common, "-o", f"{folder}/m.toml"]).output
    assert re.search(r"table\.J .* kg .* of force", fitted)
    for rotary in ("N*m", "kg*m", "N·m", "rad", "torque\n"):
        assert rotary not in told + fitted


def test_a_diagnosis_of_a_linear_axis_is_told_in_newtons(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """In the terminal and in the report; a phase stays an angle."""
    asked: dict[str, Any] = {"mode": "balance", "effort": "quick", "experiment": False}
    found = diagnose(Machine.load(EMPS), emps().between(0.0, 2.5), **asked)
    assert found.candidates
    show(found)
    told = capsys.readouterr().out
    written = re.sub(r"<(script|style)\b.*?</\1>|<[^>]*>", " ", page(found), flags=re.DOTALL)
    for shown in (told, written):
        assert re.search(r"coulomb@table.* torque \d[\d.]* N \[", shown, re.DOTALL)
        assert not re.findall(r"N[·*]m|kg[·*]m|rad/s", shown)


def test_the_limit_at_which_a_candidate_stands_is_told_on_the_axis() -> None:
    """It was told in N·m·s²/rad²."""
    machine = Machine.load(EMPS)
    law = Hypothesis((("hydrostatic_drag", "table"),))
    grown, paths = law.put_in(machine.core)
    free = law.unknowns(grown, paths, {})
    refit: Any = SimpleNamespace(grown=grown, free=free, v=[p.bounds[0] for p in free])
    told = _stuck(machine, refit, "hydrostatic_drag@table.quadratic")
    assert told == "quadratic = 0 N·s²/m², its lower limit"
