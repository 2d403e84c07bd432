"""What the verbs share: how they fail, how they write JSON, how they take a machine.

Exit codes: 0 done; 1 a computation failed or a result could not be written; 2 the command line or
an input file makes no sense, and nothing was computed; 130 stopped with Ctrl-C, 143 by SIGTERM.
"""

from __future__ import annotations

import functools
import json
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import click
from rich.console import Console

from dualdrive.files import write_atomically
from dualdrive.machine import DEFAULT, Machine
from dualdrive_cli._failures import FAILED as FAILED
from dualdrive_cli._failures import USAGE as USAGE
from dualdrive_cli._failures import end_with
from dualdrive_cli._failures import give_up as give_up
from dualdrive_cli._files import JSON, MACHINE, Files
from dualdrive_cli._keys import SETTING
from dualdrive_cli._numbers import Real
from dualdrive_cli._stop import STOPPED as STOPPED
from dualdrive_cli._stop import guard

P = ParamSpec("P")
R = TypeVar("R")


def verb(function: Callable[P, R]) -> Callable[P, R]:
    """Hold the rule for files, and turn what a verb can raise into one line and an exit code."""

    @functools.wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        files = None
        try:
            guard.running = True
            context = click.get_current_context(silent=True)
            if context is None:  # called as a function
                return function(*args, **kwargs)
            files = Files(context)
            with files:
                guard.release = files.release
                result = function(*args, **kwargs)
                if sys.stdout:  # closed by whoever called: what is written stands all the same
                    sys.stdout.flush()  # here, where a full disk can still be told
                return result
        except Exception as error:
            if guard.pressed:  # what Ctrl-C broke fails in words of its own
                give_up(_kept(files), STOPPED)
            end_with(error)
        except KeyboardInterrupt:
            give_up(_kept(files), STOPPED)
        finally:
            guard.running = False

    return guarded


def _kept(files: Files | None) -> str:
    """What a stopped verb leaves behind."""
    if not files:
        return "stopped"
    written = ", ".join(str(path) for path in files.written())
    return f"stopped; written before: {written}" if written else "stopped; nothing was written"


def console(*, err: bool = False) -> Console:
    """A console; wide where no terminal cuts the lines.

    What is printed is what it says: names of records and machines may hold brackets and colons.
    """
    screen = Console(stderr=err, highlight=False, markup=False, emoji=False)
    if not screen.is_terminal:
        screen.width = 160
    return screen


def command_line() -> str:
    """The command as it was typed, for histories and result files."""
    typed = shlex.join(["dualdrive", *sys.argv[1:]])
    return typed.encode("utf-8", "backslashreplace").decode("utf-8")  # names may be any bytes


def write_json(destination: str | None, content: Any) -> None:
    """Write figures as JSON to a file, whole or not at all, or to standard output for "-"."""
    if destination is None:
        return
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    if destination == "-":
        click.echo(text)
        return
    with write_atomically(Path(destination)) as temporary:
        temporary.write_text(text + "\n", "utf-8")


def load(machine: str, settings: tuple[str, ...] = ()) -> Machine:
    """The machine of this name or file, with the settings key=value applied in their order."""
    m = Machine.load(machine)
    for path, value in pairs(settings):
        m.set(path, value)
    return m


def pairs(settings: tuple[str, ...]) -> list[tuple[str, str]]:
    """Split key=value. Raises click.BadParameter."""
    found = []
    for text in settings:
        key, sign, value = text.partition("=")
        if not sign or not key.strip():
            raise click.BadParameter(f"{text!r} is not key=value, e.g. meshes.gap=20arcsec")
        found.append((key.strip(), value.strip()))
    return found


machine_argument = click.argument("machine", type=MACHINE, default=DEFAULT)
machine_file_argument = click.argument("machine", type=MACHINE)
set_option = click.option(
    "--set",
    "settings",
    type=SETTING,
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a parameter or choice; repeatable. Units welcome: --set meshes.gap=20arcsec",
)
json_option = click.option(
    "--json",
    "json_to",
    type=JSON,
    metavar="FILE|-",
    help="Write the figures as JSON; - for standard output.",
)
engine_option = click.option(
    "--engine",
    type=click.Choice(["auto", "exact", "exponential", "explicit", "cvode"]),
    default="auto",
    show_default=True,
    help="auto takes exact where every effect is affine between switches.",
)
method_option = click.option(
    "--method",
    type=click.Choice(["auto", "adams", "bdf"]),
    default="auto",
    help="Of cvode; adams or bdf asks for it.",
)
rtol_option = click.option(
    "--rtol",
    type=Real(),
    default=1e-10,
    show_default=True,
    help="Relative tolerance of every step; exact takes none.",
)
scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Compute on the workers of this Dask scheduler: tcp://HOST:8786.",
)
overwrite_option = click.option(
    "--overwrite", is_flag=True, help="Replace an output file that is there already."
)


def analysis(function: Callable[..., Any]) -> Callable[..., Any]:
    """The head of a verb that looks into one machine; stands below the verb's own options.

    Gives it `machine`, `settings`, `json_to` and `overwrite`, and the guard of `verb`.
    """
    function = verb(function)
    for head in (overwrite_option, json_option, set_option, machine_argument):
        function = head(function)
    return function
