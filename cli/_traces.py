"""What verbs that take measured traces share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from dualdrive.machine import Machine
from dualdrive.motion import parse_motion
from dualdrive.traces import Trace, read

traces_argument = click.argument(
    "traces", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="TRACE..."
)
map_option = click.option(
    "--map",
    "mapping",
    type=click.Path(path_type=Path),
    help="How the columns become channels; the mapping beside a trace unless given.",
)
mode_option = click.option(
    "--mode",
    type=click.Choice(["auto", "closed_loop", "balance"]),
    default="auto",
    show_default=True,
    help="Simulate the loop, or close the torque balance where the controller is unknown.",
)
motion_option = click.option(
    "--motion", help="Commanded motion of traces that carry no theta_ref; see dualdrive simulate."
)
start_option = click.option(
    "--start",
    type=click.Choice(["auto", "rest", "settled"]),
    default="auto",
    show_default=True,
    help="Were the drives switched on with the first sample, or had they held it for long?",
)
offsets_option = click.option(
    "--offsets",
    type=click.Choice(["all", "encoders", "none"]),
    default="all",
    show_default=True,
    help="Which sensors may read too much by a constant.",
)
interpolation_option = click.option(
    "--interpolation",
    type=click.Choice(["auto", "cubic", "linear", "hold"]),
    default="auto",
    show_default=True,
    help="Of the recorded command between its samples.",
)


def read_all(paths: Sequence[Path], mapping: Path | None) -> dict[str, Trace]:
    """Every trace under the shortest name that tells it from the others.

    Raises TraceError naming file, rows, rule and way out.
    """
    stems = [path.stem for path in paths]
    names = stems if len(set(stems)) == len(stems) else [str(path) for path in paths]
    if len(set(names)) < len(names):
        raise click.BadParameter("the same trace is named twice")
    return {name: read(path, mapping) for name, path in zip(names, paths, strict=True)}


def replay_options(
    machine: Machine, *, motion: str | None, start: str, offsets: str, interpolation: str
) -> dict[str, Any]:
    """Keywords that compare and fit take alike."""
    return {
        "motion": parse_motion(motion, axis=machine.axis) if motion else None,
        "start": start,
        "offsets": offsets,
        "interpolation": interpolation,
    }
