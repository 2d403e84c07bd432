"""Every verb with a command line that is cheap, and the options that it takes, from the CLI itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import click

from dualdrive_cli.main import main

_RECORDS: Final = ("machine.toml", "record.csv", "--mode", "balance")
#: verb -> what else a cheap line of it needs; a verb that is new stands alone
CHEAP: Final[dict[str, tuple[str, ...]]] = {
    "add": ("bench", "coulomb@table", "-o", "new.toml"),
    "bode": ("bench",),
    "compare": _RECORDS,
    "cycles": ("bench",),
    "demo": ("-o", "new", "--no-pictures", "--budget", "1"),
    "diagnose": (*_RECORDS, "--budget", "1"),
    "effects": (),
    "fit": (*_RECORDS, "--free", "table.J"),
    "improve": (*_RECORDS, "--budget", "1", "--most", "1", "-o", "new.toml"),
    "indexing": ("bench", "--targets", "0,1deg", "--repeats", "1"),
    "machine history": ("machine.toml",),
    "machine new": ("--preset", "bench", "-o", "new.toml"),
    "machine show": ("bench",),
    "machine undo": ("machine.toml", "-o", "new.toml"),
    "map": ("record.csv", "-o", "new.toml"),
    "optimise": ("bench", "--over", "controller.T_ten=0,1", "--no-corners"),
    "paper": ("fig2",),
    "play": ("record.csv", "--machine", "bench"),
    "report": (*_RECORDS, "--budget", "1", "--no-ladder", "-o", "new.html"),
    "simulate": ("bench", "--end", "0.1"),
    "sweep": ("bench", "--end", "0.05", "--table.J", "1,2", "-o", "new.h5"),
    "tune": ("bench", "--until", "1"),
    "workbench": ("--no-browser",),
}


class Line(NamedTuple):
    """A verb, the rest of a cheap line of it, and its parameters."""

    verb: str
    rest: tuple[str, ...]
    parameters: list[click.Parameter]


def lines() -> Iterator[Line]:
    """One line for every verb that the command line has."""
    for verb, command in _verbs(main, ()):
        yield Line(verb, CHEAP.get(verb, ()), command.params)


def _verbs(group: click.Group, above: tuple[str, ...]) -> Iterator[tuple[str, click.Command]]:
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            yield from _verbs(command, (*above, name))
        elif command is not None:
            yield " ".join((*above, name)), command


def replaced(line: Line, option: str, value: str) -> list[str]:
    """The line with an option set to a value, in the place of the one it has."""
    rest = list(line.rest)
    if option in rest:
        at = rest.index(option)
        del rest[at : at + 2]
    return [*line.verb.split(), *rest, option, value]
