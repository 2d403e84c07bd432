"""Numbers with units. Expected values are definitions (turn, minute, arc second), never ours."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dualdrive import units
from dualdrive.readable import interval
from dualdrive.units import Conversion, UnitError, conversion, human, is_unit, parse, parse_values

ARCSEC = math.pi / 180 / 3600
RPM = 2 * math.pi / 60


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("20arcsec", "rad", 20 * ARCSEC),
        ("22.7″", "rad", 22.7 * ARCSEC),
        ("1.1mrad", "rad", 1.1e-3),
        ("1.1 mrad", "rad", 1.1e-3),
        ("−3 arcmin", "rad", -180 * ARCSEC),
        ("2°", "rad", math.pi / 90),
        ("1 turn", "rad", 2 * math.pi),
        ("1.5 kN*m", "N*m", 1500.0),
        ("1.5kNm", "N*m", 1500.0),
        ("1.5 kN·m", "N*m", 1500.0),
        ("300 Nmm", "N*m", 0.3),
        ("10 mNm", "N*m", 0.010),
        ("1500rpm", "rad/s", 1500 * RPM),
        ("1500 1/min", "rad/s", 1500 * RPM),
        ("1500 min-1", "rad/s", 1500 * RPM),
        ("1500 U/min", "rad/s", 1500 * RPM),
        ("2 °/s", "rad/s", math.pi / 90),
        ("30 1/min", "1/s", 0.5),
        ("12 kNm/arcmin", "N*m/rad", 12e3 / (60 * ARCSEC)),
        ("3 Nms", "N*m*s/rad", 3.0),
        ("45 kgcm²", "kg*m^2", 45e-4),
        ("0.045kgm2", "kg*m^2", 0.045),
        ("150 mΩ", "ohm", 0.150),
        ("3mH", "H", 3e-3),
        ("5/s", "1/s", 5.0),
        ("5 m/min/mm", "1/s", 5 * 1000 / 60),
        ("1 V/krpm", "V*s/rad", 1 / (1000 * RPM)),
        ("0.39 %/K", "1/K", 0.0039),
        ("60%", "", 0.6),
        ("0.6", "", 0.6),
        ("1e-3", "rad", 1e-3),
        (".5", "s", 0.5),
    ],
)
def test_what_engineers_write(text: str, unit: str, expected: float) -> None:
    assert parse(text, unit) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit", "rule"),
    [
        ("5 rpm", "1/s", "counts an angle"),  # would silently become 0.52
        ("5 deg", "", "counts an angle"),
        ("5 N*m/deg", "N*m", "counts an angle"),
        ("100 Hz", "rad/s", "turns per second"),  # 100 or 628
        ("100 Hz", "1/s", "turns per second"),
        ("5 N*m", "rad", "does not measure rad"),
        ("3 kg", "kg*m^2", "does not measure"),
        ("5 foo", "rad", "is not a unit"),
        ("5 5 rad", "rad", "is not a unit"),
        ("1,5 mrad", "rad", "decimal sign is a point"),
        ("abc", "rad", "not a number"),
        ("", "rad", "not a number"),
        ("nan", "rad", "not a number"),
        ("1e999", "rad", "finite"),
        ("60%", "N*m", "no rated value"),
        ("25degC", "K", "ambiguous"),
    ],
)
def test_refusals_name_key_value_rule_and_way_out(text: str, unit: str, rule: str) -> None:
    with pytest.raises(UnitError) as caught:
        parse(text, unit, key="mesh_1.gap")
    message = str(caught.value)
    assert message.startswith(f"mesh_1.gap = {text!r}: ")
    assert rule in message
    assert "; write " in message
    assert "\n" not in message


def test_numbers_pass_as_si_but_booleans_and_nan_do_not() -> None:
    assert parse(1.1e-3, "rad") == 1.1e-3
    assert parse(3, "N*m") == 3.0
    for bad in (True, math.nan, math.inf):
        with pytest.raises(UnitError):
            parse(bad, "rad")


def test_percent_of_rated() -> None:
    assert parse("60%", "N*m", reference=100.0) == pytest.approx(60.0)
    assert parse("-150 %", "N*m", reference=-10.0) == pytest.approx(15.0)


def test_range_includes_its_ends() -> None:
    values = parse_values("0:1e-3:20", "rad")
    assert values.shape == (20,)
    assert values[0] == 0.0
    assert values[-1] == 1e-3
    np.testing.assert_allclose(np.diff(values), 1e-3 / 19)
    np.testing.assert_allclose(parse_values("0:1.1mrad:3", "rad"), [0, 0.55e-3, 1.1e-3])
    np.testing.assert_allclose(parse_values("0:60%:3", "N*m", reference=200.0), [0, 60, 120])
    np.testing.assert_array_equal(parse_values("2:2:1"), [2.0])


def test_lists_and_single_values() -> None:
    np.testing.assert_allclose(parse_values("1, 2mrad,20arcsec", "rad"), [1, 2e-3, 20 * ARCSEC])
    np.testing.assert_array_equal(parse_values(3.5), [3.5])
    np.testing.assert_array_equal(parse_values("3.5"), [3.5])


@pytest.mark.parametrize("text", ["0:1", "0:1:2:3", "0:1:0", "0:1:-3", "0:1:2.5", "0:1:1", "1,,2"])
def test_bad_ranges(text: str) -> None:
    with pytest.raises(UnitError, match=r"^machine\.x = "):
        parse_values(text, "rad", key="machine.x")


@pytest.mark.parametrize(("given", "declared"), units._EVERYDAY)
def test_what_is_met_every_day_is_what_the_library_of_all_units_has(
    given: str, declared: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the same bits, whichever way it came."""
    quick = units.conversion.__wrapped__(given, declared)
    monkeypatch.setattr(units, "_EVERYDAY", {})
    assert units.conversion.__wrapped__(given, declared) == quick


def test_conversion_of_temperatures_has_an_offset() -> None:
    assert conversion("degC", "K") == pytest.approx(Conversion(1.0, 273.15))
    assert conversion("arcsec", "rad").scale == pytest.approx(ARCSEC, rel=1e-15)


def test_is_unit() -> None:
    assert all(map(is_unit, ["rpm", "°/s", "N*m", "%", "", "kg*m^2"]))
    assert not any(map(is_unit, ["5", "ENC1", "#", "m m 2", "a[0]"]))


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (22.7 * ARCSEC, "rad", "22.7 arcsec"),
        (1.1e-3, "rad", "1.1 mrad"),
        (2.0, "rad", "2 rad"),
        (1500.0, "N*m", "1.5 kN·m"),
        (2e7, "N*m/rad", "20 MN·m/rad"),
        (3e6, "kg*m^2", "3e+06 kg·m²"),
        (3e-3, "H", "3 mH"),
        (7200.0, "s", "7200 s"),
        (0.25, "ohm", "250 mΩ"),
        (999.99, "N*m", "1 kN·m"),
        (0.0, "N*m", "0 N·m"),
        (0.6, "", "0.6"),
    ],
)
def test_human(value: float, unit: str, text: str) -> None:
    assert human(value, unit) == text


def test_human_prefers() -> None:
    assert human(1500 * RPM, "rad/s", prefer="rpm") == "1500 rpm"
    assert human(300 * ARCSEC, "rad", prefer="arcmin") == "5 arcmin"


def test_human_takes_the_unit_of_another() -> None:
    assert human(950e-6, "m", like=1.05e-3) == "0.95 mm"
    assert human(0.0, "m", like=1.05e-3) == "0 mm"


@pytest.mark.parametrize(
    ("value", "low", "high", "unit", "text"),
    [
        (998e-6, 950e-6, 1.05e-3, "m", "0.998 mm [0.95 .. 1.05 mm]"),
        (12001.0, 11999.0, 12004.0, "N*m", "12.001 kN·m [11.999 .. 12.004 kN·m]"),
        (0.9e-3, 0.8e-3, 1.1e-3, "rad", "0.9 mrad [0.8 .. 1.1 mrad]"),
        (2e-6, -5e-3, 5e-3, "m", "0.002 mm [-5 .. 5 mm]"),
        (0.38e-3, 2.4e-10, 6.8e-3, "rad/s", "0.38 mrad/s [0 .. 6.8 mrad/s]"),
        (4e-3, 4e-3, math.inf, "s", "4 ms [4 .. inf ms]"),
        (0.0, -0.5, 0.5, "", "0 [-0.5 .. 0.5]"),
        (2e-3, math.nan, math.nan, "s", "2 ms"),
        (3.0, 3.0, 3.0, "", "3"),
        (math.nan, math.nan, math.nan, "m", "–"),
    ],
)
def test_an_interval_stands_in_one_unit(
    value: float, low: float, high: float, unit: str, text: str
) -> None:
    assert interval(value, low, high, unit) == text


UNITS = ["rad", "rad/s", "N*m", "N*m/rad", "kg*m^2", "N*m*s/rad", "1/s", "s", "A", "ohm", "H", "m"]


@given(
    st.floats(-1e12, 1e12, allow_nan=False).filter(lambda x: x == 0 or abs(x) > 1e-12),
    st.sampled_from(UNITS),
)
def test_what_is_printed_can_be_read_back(value: float, unit: str) -> None:
    assert parse(human(value, unit, digits=17), unit) == pytest.approx(value, rel=1e-13)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_plain_numbers_survive_exactly(value: float) -> None:
    assert parse(repr(value), "N*m") == value


def test_plain_numbers_load_no_unit_library() -> None:
    code = (
        "import sys, dualdrive.units as u; u.parse('1e-3', 'rad'); sys.exit('pint' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


TOWERS = [
    "kg^9^9^9^9",
    "kg**9**9**9**9",
    "kg^(9^9^9)",
    "kg^(9)^9^9^9",
    "(((((km^9)^9)^9)^9)^9)^9",
    "km^(9*9*9*9*9*9*9*9*9*9*9*9*9)",
    "9^9^9^9*kg",
    "km⁹⁹⁹⁹⁹⁹⁹⁹⁹",
    "kg*" * 5000 + "kg",
]


def test_powers_of_powers_are_no_unit() -> None:
    """In a process of its own that has 60 s of the processor: the library would compute them."""
    code = f"""
import resource
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
from dualdrive.units import UnitError, conversion, is_unit, parse
for tower in {TOWERS!r}:
    print(tower[:40], flush=True)
    assert not is_unit(tower)
    for use in (lambda: conversion(tower, "kg"), lambda: parse("1 " + tower, "kg")):
        try:
            use()
        except UnitError as error:
            assert len(str(error)) < 300
        else:
            raise SystemExit("accepted")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, f"the last of {done.stdout}{done.stderr}"


def test_a_table_whose_units_are_powers_of_powers_is_refused(tmp_path: Path) -> None:
    """In a header and in a mapping, likewise in a process of its own."""
    code = f"""
import resource
from pathlib import Path
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
from dualdrive.traces import TraceError, read
for tower in {TOWERS!r}:
    print(tower[:40], flush=True)
    Path("header.csv").write_text(f"t [s],theta_1 [{{tower}}]\\n0,1\\n0.1,2\\n")
    Path("plain.csv").write_text("t [s],theta_1 [rad]\\n0,1\\n0.1,2\\n")
    Path("map.toml").write_text(f"[columns.theta_1]\\nchannel = 'theta_1'\\nunit = '{{tower}}'\\n")
    for files in (["header.csv"], ["plain.csv", "map.toml"]):
        try:
            read(*files)
        except TraceError as error:
            assert "is not a unit" in str(error) and len(str(error)) < 400, error
        else:
            raise SystemExit(f"accepted in {{files[-1]}}")
"""
    asked = [sys.executable, "-c", code]
    done = subprocess.run(asked, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, f"the last of {done.stdout}{done.stderr}"


@pytest.mark.parametrize("unit", ["kg^(9)", "(m/s)^2", "N*m*s^2/rad^2", "m^-1", "m^.5", "1/s^2"])
def test_plain_powers_are_units(unit: str) -> None:
    assert is_unit(unit)


def test_a_range_that_does_not_fit_is_refused() -> None:
    with pytest.raises(UnitError, match=r"takes about 64 TB of memory, .*give a smaller count"):
        parse_values("0:1:1000000000000", key="--targets")
    with pytest.raises(UnitError, match="a whole count"):
        parse_values("0:1:" + "9" * 5000, key="--targets")


@pytest.mark.parametrize("value", [10**400, {}, [], None, object()])
def test_what_is_no_number_is_refused_in_words(value: object) -> None:
    with pytest.raises(UnitError, match=r"^gap = .*: must be .*; write"):
        parse(value, "rad", key="gap")  # type: ignore[arg-type]


def test_digits_are_ascii_without_joints() -> None:
    for text in ("1_0", "١٠", "1_0 mm"):
        with pytest.raises(UnitError):
            parse(text, "m")
