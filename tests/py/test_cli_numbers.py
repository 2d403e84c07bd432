"""Every number on the command line is one: read from the commands themselves."""

from __future__ import annotations

import shutil
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

import dualdrive
from commands import Leaf, leaves, required
from dualdrive_cli._files import Reads, WorksIn, Writes, WritesInto
from dualdrive_cli._numbers import Real, Whole
from dualdrive_cli.main import main

DEMO = Path(dualdrive.__file__).parent / "demo"

#: options whose value is a word of the user's own choice, which may well be "nan"
WORDS = {("machine new", "name"), ("fit", "scheduler"), ("sweep", "scheduler")}

#: what a command wants that is no option of its own
GRID = {"sweep": ("--delta", "0:1mrad:2")}

FILES = (Reads, Writes, WritesInto, WorksIn)


def valued(leaf: Leaf) -> list[click.Option]:
    """Options that take a value other than a file."""
    return [
        param
        for param in leaf.command.params
        if isinstance(param, click.Option)
        and not (param.is_flag or param.count or isinstance(param.type, FILES))
        and (leaf.name, param.name) not in WORDS
    ]


TABLE = [
    pytest.param(leaf, option, id=f"{leaf.name}-{option.name}")
    for leaf in leaves()
    for option in valued(leaf)
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a machine and a record that are right."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(DEMO / "machine.toml", tmp_path)
    shutil.copy(DEMO / "fit.csv", tmp_path / "traces.csv")
    return tmp_path


def test_the_table_is_not_empty() -> None:
    assert len(TABLE) >= 100
    options = [option for leaf in leaves() for option in valued(leaf)]
    assert sum(isinstance(option.type, Real | Whole) for option in options) >= 25


@pytest.mark.parametrize(("leaf", "option"), TABLE)
def test_a_number_has_a_type_that_knows_nan(leaf: Leaf, option: click.Option) -> None:
    kind = option.type
    numeric = isinstance(kind, click.types.FloatParamType | click.types.IntParamType)
    assert isinstance(kind, Real | Whole) or not numeric


@pytest.mark.parametrize(("leaf", "option"), TABLE)
@pytest.mark.parametrize("value", ["nan", "inf"])
def test_nan_is_refused(leaf: Leaf, option: click.Option, value: str, folder: Path) -> None:
    """Whatever the option is for: as a number, as text with a unit, as a choice or a key."""
    before = sorted(folder.iterdir())
    assert option.nargs == 1, "an option of several numbers: spell it out here"
    words = [*required(leaf), *GRID.get(leaf.name, ()), f"{option.opts[0]}={value}"]
    result = CliRunner().invoke(main, [*leaf.words, *words])
    assert result.exit_code == 2, (result.output, result.exception)
    assert value in result.stderr
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("value", ["1_0", "1e400", "NaN", "infinity"])
def test_numbers_of_programs_are_refused(value: str, folder: Path) -> None:
    result = CliRunner().invoke(main, ["diagnose", "machine.toml", "traces.csv", "--budget", value])
    assert result.exit_code == 2
    assert f"{value} is not a finite number" in result.stderr


@pytest.mark.parametrize("leaf", [pytest.param(leaf, id=leaf.name) for leaf in leaves()])
def test_no_help_shows_a_limit_that_is_none(leaf: Leaf) -> None:
    assert "None" not in CliRunner().invoke(main, [*leaf.words, "--help"]).output


@pytest.mark.parametrize(
    ("words", "option", "text", "si"),
    [
        ("play", "load", "5 kN*m", 5e3),
        ("play", "settle", "300ms", 0.3),
        ("play", "confidence", "95%", 0.95),
        ("compare", "cutoff", "20Hz", 20.0),
        ("diagnose", "budget", "2min", 120.0),
        ("tune", "tolerance_db", "1dB", 1.0),
        ("tune", "tolerance_deg", "6arcmin", 0.1),
    ],
)
def test_every_number_takes_its_unit(words: str, option: str, text: str, si: float) -> None:
    leaf = next(leaf for leaf in leaves() if leaf.name == words)
    param = next(p for p in leaf.command.params if p.name == option)
    assert param.type.convert(text, param, None) == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize(
    ("verb", "shown"),
    [("play", "[default: 0.3s;"), ("tune", "[default: 1dB;"), ("tune", "[default: 5deg;")],
)
def test_a_default_is_told_with_its_unit(verb: str, shown: str) -> None:
    assert shown in " ".join(CliRunner().invoke(main, [verb, "--help"]).output.split())


def test_a_unit_of_something_else_is_refused(folder: Path) -> None:
    result = CliRunner().invoke(main, ["play", "traces.csv", "--settle", "3m"])
    assert result.exit_code == 2
    assert "--settle = '3m': m does not measure s; write s, e.g. 100ms" in result.stderr


def test_a_state_begins_in_its_own_unit() -> None:
    line = "simulate bench --end 1ms --signal omega_m --initial omega_m=1mrad/s --json -"
    assert CliRunner().invoke(main, line.split()).exit_code == 0
    wrong = CliRunner().invoke(main, line.replace("mrad/s", "mrad").split())
    assert wrong.exit_code == 2
    assert "--initial omega_m = '1mrad': mrad does not measure rad/s" in wrong.stderr


def test_the_usual_tolerance_is_told() -> None:
    for verb in ("simulate", "sweep"):
        shown = " ".join(CliRunner().invoke(main, [verb, "--help"]).output.split())
        assert "[default: 1e-10]" in shown, verb
