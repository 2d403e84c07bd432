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
