"""How a verb fails: one line on stderr and an exit code, whatever was raised."""

from __future__ import annotations

import os
import sys
from typing import NoReturn

import click

from dualdrive.echo import shorten
from dualdrive.files import WriteError
from dualdrive_cli._stop import STOPPED, guard

FAILED, USAGE = 1, 2
_NOTHING_STARTS = (
    "no thread or process can be started: memory or their number is used up; close other programs"
)


def give_up(message: object, code: int) -> NoReturn:
    """End the command with one line on stderr."""
    click.echo(f"dualdrive: {shorten(str(message))}", err=True)
    raise SystemExit(guard.code if code == STOPPED else code)


def end_with(error: Exception) -> NoReturn:
    """End the command as this error asks for; one that no verb may raise is raised again."""
    match error:
        case BrokenPipeError():  # the reader, `head` say, has seen enough
            sys.stdout = None
            raise SystemExit(0) from None
        case OSError(filename=str() | bytes() as name):
            give_up(f"{os.fsdecode(name)}: {error.strerror}; name another file", USAGE)
        case BlockingIOError():  # no more processes
            give_up(_NOTHING_STARTS, FAILED)
        case OSError():
            # what is still buffered would fail again at the end, with an exit code of its own
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            give_up(f"standard output cannot be written: {error.strerror}", FAILED)
        case MemoryError():
            give_up("out of memory; ask for fewer or coarser samples, or a smaller grid", FAILED)
        case RecursionError():
            give_up("nested too deeply; write it flatter", USAGE)
        case OverflowError():
            give_up(f"a number is too large: {error}; give a smaller one", USAGE)
        case RuntimeError() if "can't start new thread" in str(error):
            give_up(_NOTHING_STARTS, FAILED)
        case WriteError() | RuntimeError():  # a fit that can't be done, among others
            give_up(error, FAILED)
        case KeyError():
            give_up(error.args[0] if error.args else error, USAGE)
        case ValueError():
            give_up(error, USAGE)
    raise error
