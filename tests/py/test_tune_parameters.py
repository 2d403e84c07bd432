"""Drive parameters by number: values by hand, files out and in, and what is refused."""

from __future__ import annotations

import json
import math
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

from dualdrive.files import FileError
from dualdrive.machine import Machine
from dualdrive.tune import (
    KNOWN,
    MotionLimits,
    TuneError,
    drive_parameters,
    read_drive_parameters,
    set_drive_parameters,
    table_csv,
    table_json,
    table_text,
)

LIMITS = MotionLimits(0.01, 0.05)


@pytest.fixture
def heavy() -> Machine:
    return Machine.load("heavy-table-550t")


def test_values_by_hand(heavy: Machine) -> None:
    """From the machine's data sheet: i = 150, 157 rad/s and 100 N*m at the motor."""
    table = drive_parameters(heavy, LIMITS)
    v_max = 157 / 150  # at the pinion
    by_hand = {
        "32200": 5 * 60 / 1000,
        "32300": 0.01 / (2 * math.pi),
        "32431": 0.05 / (2 * math.pi),
        "32610": 1.0,
        "32620": 1.0,
        "37254": 0.0,
        "37256": 100 * (0.5 * 150 / (2 * 2e5)) * 100 / v_max,
        "37258": 0.1,
        "37260": 100 * 0.1 / v_max,
        "37262": 1.0,
        "37264": 60.0,
        "37266": 0.1,
        "37268": 50.0,
        "p1460": 2e5 / 150**2,
        "p1462": 100.0,
        "p1656": 0.0,
    }
    known = {n for n, entry in table.entries.items() if entry.value is not None}
    assert known == set(by_hand)
    for number, value in by_hand.items():
        assert table[number] == pytest.approx(value, rel=1e-12), number


def test_a_percentage_is_of_the_motor_it_names(heavy: Machine) -> None:
    heavy.set("motor_1.T_rated", 200.0)
    assert drive_parameters(heavy)["37264"] == pytest.approx(30.0)


def test_what_no_manual_was_read_for_is_marked(heavy: Machine) -> None:
    """The paper names three numbers; all others are from memory and say so wherever they go."""
    named = {"37256", "37258", "37264"}
    table = drive_parameters(heavy, LIMITS)
    for number, row in table_json(table).items():
        assert (row["source"] == "paper, section 3.3") == (number in named)
        assert row["source"] in ("paper, section 3.3", "to be verified")
    rows = [line for line in table_text(table).splitlines()[1:] if line.split()[0] not in named]
    assert rows
    assert all(line.endswith("to be verified") for line in rows)
    assert table_csv(table).count("to be verified") == len(rows)


def test_the_printed_table_has_the_names_and_every_word_under_its_head(heavy: Machine) -> None:
    table = drive_parameters(heavy, LIMITS)
    head, *lines = table_text(table).splitlines()
    names = ("number", "name", "value", "unit", "set in", "meaning", "source")
    at = [head.index(name) for name in names]
    cells = [[line[a:b].strip() for a, b in pairwise([*at, None])] for line in lines]
    for cell, (number, row) in zip(cells, table_json(table).items(), strict=True):
        told = [row[key] for key in ("name", "unit", "where", "meaning", "source")]
        assert [cell[0], cell[1], *cell[3:]] == [number, *told]


def toml_of(text: str) -> str:
    rows = json.loads(text)
    lines = []
    for number, row in rows.items():
        pairs = [f"{axis} = {row[axis]!r}" for axis in ("master", "slave") if row[axis] is not None]
        if pairs:
            lines.append(f"{number} = {{ {', '.join(pairs)} }}")
    text = "[drive_parameters]\n" + "\n".join(lines) + "\n"
    tomllib.loads(text)
    return text


@pytest.mark.parametrize("kind", ["csv", "json", "toml"])
def test_round_trip(heavy: Machine, tmp_path: Path, kind: str) -> None:
    """Into a machine of other numbers: every one that a control has comes back."""
    heavy.set("controller.equaliser", "slave")
    heavy.set("controller.w", 0.45)
    table = drive_parameters(heavy, LIMITS)
    plain = json.dumps(table_json(table))
    texts = {"csv": table_csv(table), "json": plain, "toml": toml_of(plain)}
    path = tmp_path / f"drives.{kind}"
    path.write_text(texts[kind])
    other = Machine.load("heavy-table-550t")
    for name, value in {"K_v": 3.0, "k_p": 1e5, "T_N": 0.3, "T_ten": 0.0, "T_E": 1.0, "f_v": 0.0,
                        "g_E": 0.1, "Omega_E": 0.01, "tau_t": 0.5}.items():  # fmt: skip
        other.set(f"controller.{name}", value)
    before = other.toml()
    applied = set_drive_parameters(other, read_drive_parameters(path, other))
    assert other.toml() == before
    assert applied.limits is not None
    assert applied.limits.acceleration == pytest.approx(0.01, rel=1e-12)
    assert applied.limits.jerk == pytest.approx(0.05, rel=1e-12)
    for wanted, got in zip(heavy.parameters(), applied.machine.parameters(), strict=True):
        assert got.value == pytest.approx(wanted.value, rel=1e-12), wanted.path
    assert applied.machine.core.controller_options == heavy.core.controller_options


def test_units_are_taken(heavy: Machine, tmp_path: Path) -> None:
    path = tmp_path / "drives.toml"
    path.write_text('37264 = "45 N*m"\np1462 = "0.2 s"\nMD32200 = "8 1/s"\n37268 = "40 %"\n')
    machine = set_drive_parameters(heavy, read_drive_parameters(path, heavy)).machine
    for name, value in {"T_ten": 45.0, "T_N": 0.2, "K_v": 8.0, "w": 0.4}.items():
        assert machine.get(f"controller.{name}") == pytest.approx(value, rel=1e-12)


def test_a_new_speed_gain_leaves_the_equalisers_gain(heavy: Machine, tmp_path: Path) -> None:
    """MD37256 is a number of its own, so that g_E = 2 K_E k_p / i goes with the speed gain."""
    path = tmp_path / "drives.csv"
    path.write_text(f"number,value\np1460,{1e5 / 150**2}\n")
    machine = set_drive_parameters(heavy, read_drive_parameters(path, heavy)).machine
    assert machine.get("controller.g_E") == pytest.approx(0.25, rel=1e-12)
    assert drive_parameters(machine)["37256"] == pytest.approx(drive_parameters(heavy)["37256"])


def test_what_the_machine_has_no_place_for_is_said(heavy: Machine, tmp_path: Path) -> None:
    path = tmp_path / "drives.toml"
    path.write_text("37250 = 7\n37264 = 50\n")
    assert set_drive_parameters(heavy, read_drive_parameters(path, heavy)).unused == ("37250",)


REFUSED = {
    "unknown number": ("37299 = 1", "37299.*unknown number"),
    "wrong unit": ('37264 = "60 kg"', "37264.*kg does not measure"),
    "no number": ('37264 = "much"', "37264.*must be a number in % of rated"),
    "not finite": ("p1460 = nan", "p1460"),
    "axes differ": ("p1460 = {master = 8.9, slave = 9.2}", "p1460: master 8.9, slave 9.2"),
    "no equaliser": ("37254 = 3", "37254 = 3.*set 37256 to 0"),
    "torque feed-forward": ("32620 = 2", "32620 = 2: must be 0 or 1"),
    "coupling off": ("37262 = 0", "37262 = 0.*always active"),
    "out of bounds": ("37268 = 140", "37268 = 140.*controller.w"),
    "nothing": ("", "no drive parameter"),
}


@pytest.mark.parametrize(("text", "said"), REFUSED.values(), ids=REFUSED)
def test_refused(heavy: Machine, tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "drives.toml"
    path.write_text(text + "\n")
    before = heavy.toml()
    with pytest.raises(TuneError, match=said) as refused:
        set_drive_parameters(heavy, read_drive_parameters(path, heavy))
    assert "\n" not in str(refused.value)
    assert heavy.toml() == before


def test_files_that_are_none(heavy: Machine, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="there is no such file"):
        read_drive_parameters(tmp_path / "none.toml", heavy)
    for name, text, said in (
        ("broken.toml", "37264 = = 3", "not valid TOML"),
        ("broken.json", "{", "not JSON"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(FileError, match=said):
            read_drive_parameters(tmp_path / name, heavy)
    for name, text, said in (
        ("drives.xls", "", "must end in"),
        ("twice.csv", "number,value\n37264,5\n37264,6\n", "line 3: 37264 stands there twice"),
        ("bare.csv", "37264,5\n", "needs a line of column names"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(TuneError, match=said):
            read_drive_parameters(tmp_path / name, heavy)


def test_a_machine_without_controller_has_none(heavy: Machine) -> None:
    heavy.core.set_controller(kind="none")
    with pytest.raises(TuneError, match="no drive parameters"):
        drive_parameters(heavy)


def test_one_motor_has_no_coupling() -> None:
    numbers = set(drive_parameters(Machine.load("heavy-table-single-motor")).entries)
    assert {"32200", "p1460"} <= numbers
    assert "37264" not in numbers


def test_every_number_is_described() -> None:
    assert list(KNOWN) == sorted(KNOWN)
    assert all(p.name and p.unit and p.meaning for p in KNOWN.values())
