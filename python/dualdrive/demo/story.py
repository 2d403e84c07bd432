"""What the demo does: hold a data sheet against a record, find what it lacks, add it, test it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.resources import as_file, files
from pathlib import Path

from dualdrive.diagnose import Ladder, improve
from dualdrive.machine import Machine
from dualdrive.traces import Trace, read

_SHIPPED = ("machine.toml", "fit.csv", "held_out.csv")


@contextmanager
def shipped() -> Iterator[tuple[Path, Path, Path]]:
    """The machine file, the record to fit and the one held out, as files while this is open."""
    with ExitStack() as open_:
        sheet_, fit, held_out = (
            open_.enter_context(as_file(files("dualdrive.demo") / name)) for name in _SHIPPED
        )
        yield sheet_, fit, held_out


def sheet() -> Machine:
    """The demo's machine as its data sheet has it."""
    with shipped() as (path, _, _):
        return Machine.load(path)


def records() -> tuple[Trace, Trace]:
    """The record to fit and the one held out."""
    with shipped() as (_, fit, held_out):
        return read(fit), read(held_out)


def tell(progress: Callable[[str], None] | None = None, *, budget: float = math.inf) -> Ladder:
    """Improve the data sheet's machine by the record.

    Args:
        progress: told in words what is being tried.
        budget: seconds after which it stops; see :func:`dualdrive.diagnose.improve`.

    """
    fitting, held_out = records()
    return improve(sheet(), fitting, held_out, budget=budget, progress=progress)
