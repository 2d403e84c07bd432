"""Trace files are there whole or not at all; trouble with the disk is told as a TraceError."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dualdrive import files

from .log import TraceError

__all__ = ["write_atomically"]


@contextmanager
def write_atomically(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; on success it takes the place of `path`.

    Raises TraceError where the disk doesn't let it; what stood at `path` is untouched then.
    """
    try:
        with files.write_atomically(path) as temporary:
            yield temporary
    except files.WriteError as error:
        raise TraceError(str(error), kind="write") from error
