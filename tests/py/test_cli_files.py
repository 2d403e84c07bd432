"""No command loses a file: one rule for every output of every command, read from the commands."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from commands import (
    Leaf,
    input_name,
    inputs,
    leaves,
    output_name,
    outputs,
    required,
)
from dualdrive.files import claim
from dualdrive_cli._files import Writes, WritesInto
from dualdrive_cli.main import main

MINE = "not to be lost\n"


def table(*columns: Callable[[Leaf], Sequence[click.Parameter]]) -> list[Any]:
    """Every command with every choice of such parameters, and an id."""
    rows: list[Any] = []
    for leaf in leaves():
        chosen: list[list[click.Parameter]] = [[]]
        for column in columns:
            chosen = [[*row, param] for row in chosen for param in column(leaf)]
        for params in chosen:
            rows.append(pytest.param(leaf, *params, id="-".join((leaf.name, *map(name, params)))))
    return rows


def name(param: click.Parameter) -> str:
    return str(param.name)


def files(leaf: Leaf) -> list[click.Parameter]:
    """Outputs that are single files."""
    return [param for param in outputs(leaf) if isinstance(param.type, Writes)]


@pytest.fixture
def typed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Result]]:
    """Run a command in a folder with its inputs; afterwards nothing of it may be left behind."""
    monkeypatch.chdir(tmp_path)

    def run(leaf: Leaf, *words: str, **values: object) -> Result:
        for param in inputs(leaf):
            if not Path(input_name(param)).exists():
                Path(input_name(param)).write_text(MINE)
        line = [*required(leaf, {key: str(value) for key, value in values.items()}), *words]
        return CliRunner().invoke(main, [*leaf.words, *line], catch_exceptions=False)

    yield run
    assert not list(tmp_path.rglob(".*")), "a hidden file was left"


def refused(result: Result, code: int, *told: str) -> None:
    """One line with these words, and this exit code."""
    assert result.exit_code == code, result.output
    assert result.stderr.count("\n") == 1, result.stderr
    for words in told:
        assert words in result.stderr


def test_the_table_is_not_empty() -> None:
    assert len(leaves()) >= 20
    assert len(table(outputs)) >= 35
    assert len(table(inputs, files)) >= 40


@pytest.mark.parametrize("leaf", [pytest.param(leaf, id=leaf.name) for leaf in leaves()])
def test_every_file_obeys_the_rule(leaf: Leaf) -> None:
    """A path of another type would be neither guarded as an input nor looked at as an output."""
    for param in leaf.command.params:
        kind = param.type
        assert not isinstance(kind, click.Path | click.File), param.name
        assert getattr(kind, "func", None) is not Path, param.name
    if outputs(leaf):
        assert any(param.name == "overwrite" for param in leaf.command.params)


@pytest.mark.parametrize(("leaf", "output"), table(outputs))
def test_what_is_there_stays(
    leaf: Leaf, output: click.Parameter, typed: Callable[..., Result]
) -> None:
    there = named = output_name(output, "there")
    if isinstance(output.type, WritesInto):
        line = required(leaf, {name(output): str(there)})
        params = leaf.command.make_context(leaf.name, line).params
        there = list(output.type.files(there, params))[-1]
        there.parent.mkdir()
    there.write_text(MINE)
    result = typed(leaf, **{name(output): named})
    refused(result, 1, f"{there}: exists already", "--overwrite")
    assert there.read_text() == MINE


@pytest.mark.parametrize(("leaf", "given", "output"), table(inputs, files))
@pytest.mark.parametrize("way", ["itself", "symbolic link", "hard link"])
def test_an_input_is_never_an_output(
    leaf: Leaf,
    given: click.Parameter,
    output: click.Parameter,
    way: str,
    typed: Callable[..., Result],
) -> None:
    mine, named = output_name(output, "mine"), output_name(output, "named")
    mine.write_text(MINE)
    if way == "itself":
        named = mine
    elif way == "symbolic link":
        named.symlink_to(mine)
    else:
        named.hardlink_to(mine)
    result = typed(leaf, "--overwrite", **{name(given): mine, name(output): named})
    refused(result, 2, f"{named}: is {mine}, which is read", "name another file")
    assert mine.read_text() == MINE


@pytest.mark.parametrize(("leaf", "output"), table(files))
@pytest.mark.parametrize("leads", ["in a circle", "to nowhere, not there"])
def test_a_lost_link_is_not_replaced(
    leaf: Leaf, output: click.Parameter, leads: str, typed: Callable[..., Result]
) -> None:
    link = output_name(output, "link")
    link.symlink_to(link if "circle" in leads else "nowhere")
    result = typed(leaf, "--overwrite", **{name(output): link})
    refused(result, 1, f"a symbolic link that leads {leads}")
    assert link.is_symlink()


@pytest.mark.parametrize(
    ("leaf", "one", "other"),
    [
        pytest.param(leaf, one, other, id=f"{leaf.name}-{one.name}-{other.name}")
        for leaf in leaves()
        for one, other in combinations(files(leaf), 2)
        if output_name(one, "x") == output_name(other, "x")
        or not all(getattr(param.type, "endings", ()) for param in (one, other))
    ],
)
def test_two_outputs_are_two_files(
    leaf: Leaf, one: click.Parameter, other: click.Parameter, typed: Callable[..., Result]
) -> None:
    strict = one if getattr(one.type, "endings", ()) else other
    both = output_name(strict, "both")
    result = typed(leaf, "--overwrite", **{name(one): both, name(other): both})
    refused(result, 2, "writes to the same file")
    assert not both.exists()


@pytest.mark.parametrize(("leaf", "output"), table(outputs))
def test_one_process_at_a_time(
    leaf: Leaf, output: click.Parameter, typed: Callable[..., Result]
) -> None:
    claimed = output_name(output, "claimed")
    if isinstance(output.type, WritesInto):
        claimed.mkdir()
    with claim(claimed):
        told = f"{claimed}: another dualdrive (process {os.getpid()}) is about to write it"
        refused(typed(leaf, "--overwrite", **{name(output): claimed}), 1, told)


# --- inputs that are not named --------------------------------------------------------------------


def test_what_a_machine_rests_on_is_an_input(typed: Callable[..., Result]) -> None:
    base = Path("base.toml")
    base.write_text('schema = 1\nbase = "bench"\n')
    Path("machine.toml").write_text('schema = 1\nbase = "base.toml"\n')
    simulate = next(leaf for leaf in leaves() if leaf.words == ("simulate",))
    before = base.read_bytes()
    refused(typed(simulate, "--json", "base.toml", "--overwrite"), 2, "which is read (MACHINE)")
    assert base.read_bytes() == before


def test_the_mapping_beside_a_trace_is_an_input(typed: Callable[..., Result]) -> None:
    mapping = Path("traces.map.toml")
    mapping.write_text(MINE)
    compare = next(leaf for leaf in leaves() if leaf.words == ("compare",))
    refused(typed(compare, "-o", str(mapping), "--overwrite"), 2, "which is read (TRACE...)")
    assert mapping.read_text() == MINE


def test_a_link_is_written_through(typed: Callable[..., Result]) -> None:
    """The name stays a link; the file that it leads to is the one that is replaced."""
    Path("kept").mkdir()
    Path("kept/real.json").write_text(MINE)
    Path("link.json").symlink_to("kept/real.json")
    listing = next(leaf for leaf in leaves() if leaf.words == ("machine", "list"))
    refused(typed(listing, "--json", "link.json"), 1, "exists already")
    assert typed(listing, "--json", "link.json", "--overwrite").exit_code == 0
    assert Path("link.json").is_symlink()
    assert Path("kept/real.json").read_text() != MINE


def test_names_that_name_no_file(typed: Callable[..., Result]) -> None:
    simulate = next(leaf for leaf in leaves() if leaf.words == ("simulate",))
    for word in ("", "-"):
        result = typed(simulate, "-o", word)
        assert result.exit_code == 2
        assert "names no file" in result.stderr
    refused(typed(simulate, "-o", 300 * "x"), 1, "cannot be written: File name too long")
