"""The workbench: compare, locate, name, add, refit as a page in the browser on this computer.

    dualdrive workbench machine.toml trace.csv

Who does what:

    project    the folder: traces, ladder of models, undo; all of it on disk
    jobs       computations as processes of their own, which a lost server does not lose
    tasks      what a computation does, by the functions that the other verbs call
    keep       results on disk and back, without executing anything
    series     long series on disk, reduced to what a screen can show
    views      results as the page reads them
    guard      who may ask at all
    session    one server per project, its socket and its token
    server     addresses and what they do

The page itself is in dualdrive/web.

Threats and what meets them: docs/theory/workbench-security.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

__all__ = ["serve"]


def serve(
    folder: str | Path,
    machine: str | None = None,
    traces: Sequence[str | Path] = (),
    *,
    port: int = 0,
    ready: Callable[[str], None] | None = None,
) -> None:
    """Serve the page for a project folder until stopped; see :mod:`dualdrive.workbench.server`.

    Args:
        folder: of the project; made where there is none.
        machine: file or preset to begin with, in a project that has none.
        traces: recordings to begin with.
        port: of the loopback interface; a free one unless given.
        ready: told the page's address once it answers.

    Raises:
        FileError: a folder that can't be used, or is another workbench's.
        ImportError: the extra ``workbench`` is not installed.

    """
    from dualdrive.workbench.jobs import begin

    worker = begin()  # loads what computations need while the server loads what it needs
    from dualdrive.workbench.server import run

    run(folder, machine, traces, port=port, ready=ready, worker=worker)
