"""Every command of the command line and its options, read from the click commands themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import click

from dualdrive_cli._files import Reads, ReadsMachine, Writes, WritesInto
from dualdrive_cli.main import main


class Leaf(NamedTuple):
    """A command that does something, and the words that call it."""

    words: tuple[str, ...]
    command: click.Command

    @property
    def name(self) -> str:
        """As it is typed."""
        return " ".join(self.words)


@cache
def leaves() -> tuple[Leaf, ...]:
    """All commands without subcommands."""
    return tuple(_below((), main))


def _below(words: tuple[str, ...], command: click.Command) -> Iterator[Leaf]:
    if not isinstance(command, click.Group):
        yield Leaf(words, command)
        return
    ctx = click.Context(command)
    for name in command.list_commands(ctx):
        if (found := command.get_command(ctx, name)) is not None:
            yield from _below((*words, name), found)


#: arguments that are neither files nor machines, and a value that is right
PLAIN = {"effect": "coulomb"}


def required(leaf: Leaf, values: Mapping[str, str] | None = None) -> list[str]:
    """The words that a command needs, and those for these values by parameter name, in order.

    Inputs are called after their parameter unless a value is given: machine.toml, traces.csv.
    """
    values, words = values or {}, list[str]()
    for param in leaf.command.params:
        name = str(param.name)
        if name in values:
            words += option_words(param, values[name])
        elif isinstance(param, click.Option):
            words += [param.opts[0], f"{name}.out"] if param.required else []
        elif isinstance(param.type, Reads):
            words.append(input_name(param))
        elif param.required:
            words.append(PLAIN[name])
    return words


def input_name(param: click.Parameter) -> str:
    """A file name for an input."""
    return f"{param.name}.toml" if isinstance(param.type, ReadsMachine) else f"{param.name}.csv"


def inputs(leaf: Leaf) -> list[click.Parameter]:
    """What a command reads."""
    return [param for param in leaf.command.params if isinstance(param.type, Reads)]


def outputs(leaf: Leaf) -> list[click.Parameter]:
    """What a command writes."""
    return [param for param in leaf.command.params if isinstance(param.type, Writes | WritesInto)]


def option_words(param: click.Parameter, value: str) -> list[str]:
    """An option, or an argument, with this value as often as it wants one."""
    values = [value] * max(1, param.nargs)
    return [param.opts[0], *values] if isinstance(param, click.Option) else values


def output_name(param: click.Parameter, stem: str) -> Path:
    """A file name that the output accepts."""
    kind = param.type
    ending = kind.endings[0] if isinstance(kind, Writes) and kind.endings else ".out"
    return Path(stem + ending)
