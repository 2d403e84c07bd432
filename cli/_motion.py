"""What --motion takes: words, or a file with the commanded angle over time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import click

from dualdrive.machine import Machine
from dualdrive.motion import Motion, parse_motion, read_motion
from dualdrive_cli._files import Reads

__all__ = ["MOTION", "motion_of"]

_ENDINGS: Final = (".csv", ".txt", ".h5", ".hdf5", ".mat")


class _ReadsMotion(Reads):
    """A motion in words or as a file; stays as it was typed."""

    name = "motion"

    def convert(
        self, value: str | Path, param: click.Parameter | None, ctx: click.Context | None
    ) -> Path | str:
        """As it is."""
        return value

    def files(self, value: Path | str) -> Iterator[Path]:
        """The file, where it is one."""
        if _is_file(str(value)):
            yield Path(value)


MOTION = _ReadsMotion()


def motion_of(text: str | None, machine: Machine) -> Motion | None:
    """The motion that --motion asks for; None where nothing does."""
    if text is None:
        return None
    if _is_file(text):
        return read_motion(text, axis=machine.axis)
    return parse_motion(text, axis=machine.axis)


def _is_file(text: str) -> bool:
    """Words begin with a kind and a colon."""
    path = Path(text)
    return path.suffix.lower() in _ENDINGS or (":" not in text and path.is_file())
