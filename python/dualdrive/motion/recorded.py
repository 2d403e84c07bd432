"""A commanded motion as a file: recorded, planned, and how a plan is handed on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .builders import Motion, MotionError, sampled

if TYPE_CHECKING:
    from dualdrive.traces import Trace

__all__ = ["motion_csv", "read_command", "read_motion"]


def read_motion(path: str | Path, *, axis: str = "rotary") -> Motion:
    """The motion of the column ``theta_ref``, from the file's first time on.

    Args:
        path: of a recording, as :func:`dualdrive.traces.read` reads it; a mapping beside it counts.
        axis: of the machine: on a linear one positions may be given in m.

    Raises:
        MotionError: no such column, or fewer than two samples.
        TraceError: a file that can't be read.

    """
    command = read_command(path, axis=axis).from_zero()
    return sampled(command.t, command["theta_ref"])


def read_command(path: str | Path, *, axis: str = "rotary") -> Trace:
    """The recording that holds the column ``theta_ref``, on the file's own clock.

    Arguments and errors as for :func:`read_motion`.
    """
    from dualdrive.traces import ColumnRule, TraceMap, find_mapping, read

    mapping = None
    if axis == "linear" and find_mapping(path) is None:
        own = {name: ColumnRule(channel=name, radius="1 m") for name in ("theta_ref", "omega_ref")}
        mapping = TraceMap(columns=own)
    trace = read(path, mapping)
    if "theta_ref" not in trace:
        known = ", ".join(trace) or "nothing"
        way_out = "call the commanded angle theta_ref in its header, or in a mapping beside it"
        raise MotionError(f"{path}: no column theta_ref in it; it holds {known}; {way_out}")
    return trace


def motion_csv(motion: Motion, *, axis: str = "rotary", step: float = 1e-3) -> str:
    """A motion as a table of time, position and speed, which :func:`read_motion` reads.

    step: between samples, s; 1 ms is what the drives' controls take
    """
    t = step * np.arange(round(motion.end / step) + 1)
    unit = "m" if axis == "linear" else "rad"
    rows = np.column_stack([t, motion.waveform.value(t), motion.waveform.rate(t)])
    lines = [f"t [s],theta_ref [{unit}],omega_ref [{unit}/s]"]
    lines += [f"{time:.6g},{value:.12g},{rate:.12g}" for time, value, rate in rows.tolist()]
    return "\n".join([*lines, ""])
