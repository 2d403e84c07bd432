"""What --motion takes: words, or a file with the commanded angle over time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

import click

from dualdrive.machine import Machine
from dualdrive.motion import Motion, MotionError, parse_motion, read_command, sampled
from dualdrive.traces import Trace
from dualdrive_cli._files import Reads

__all__ = ["MOTION", "is_file", "motion_along", "motion_of"]

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
        if is_file(str(value)):
            yield Path(value)


MOTION = _ReadsMotion()


def motion_of(text: str | None, machine: Machine) -> Motion | None:
    """The motion that --motion asks for, a file's from its first time on; None where nothing does.

    What was amiss in a file is told on stderr. Raises MotionError, TraceError.
    """
    if text is None:
        return None
    if not is_file(text):
        return parse_motion(text, axis=machine.axis)
    return _sampled(_command(text, machine).from_zero())


def motion_along(
    text: str | None, machine: Machine, recorded: Mapping[str, Trace]
) -> Motion | None:
    """The motion that --motion asks for, on the clock of these records; None where nothing does.

    On stderr: records whose own theta_ref it stands in for, and those that it does not span.

    Raises MotionError where it has no time in common with a record, or as `motion_of` does.
    """
    if text is None:
        return None
    if is_file(text):
        command = _command(text, machine)
        motion, begin, most = _sampled(command), float(command.t[0]), command.step
    else:  # words say what the command does beyond their end: it stands
        motion, begin, most = parse_motion(text, axis=machine.axis), 0.0, math.inf
    for name, trace in recorded.items():
        first, last = trace.t[[0, -1]].tolist()
        spans = f"it runs from {begin:g} to {motion.end:g} s, {name} from {first:g} to {last:g} s"
        if first >= motion.end or last <= begin:
            way_out = "give it on the clock of the record"
            raise MotionError(f"--motion {text}: {spans}: no time in common; {way_out}")
        if first < begin - most or last > motion.end + most:
            click.echo(f"--motion {text}: {spans}; beyond its ends the command stands", err=True)
    if own := [name for name, trace in recorded.items() if "theta_ref" in trace]:
        told = f"stands in for the theta_ref recorded in {', '.join(own)}"
        click.echo(f"--motion {text}: {told}; leave it out to take those", err=True)
    return motion


def _command(path: str, machine: Machine) -> Trace:
    """The file's command; what was amiss in it is told."""
    command = read_command(path, axis=machine.axis)
    bridged = "; the command is interpolated across it; fill in what was commanded there"
    for issue in command.log.troubles:
        way_out = bridged if issue.kind == "gap" else ""
        click.echo(f"--motion {path}: {issue}{way_out}", err=True)
    return command


def _sampled(command: Trace) -> Motion:
    return sampled(command.t, command["theta_ref"])


def is_file(text: str) -> bool:
    """Whether a motion is given as a file; words begin with a kind and a colon."""
    path = Path(text)
    return path.suffix.lower() in _ENDINGS or (":" not in text and path.is_file())
