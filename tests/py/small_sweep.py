"""A sweep of 3 x 2 runs of a heavy table, for tests of what is in its file and of the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dualdrive.machine import Machine
from dualdrive.motion import move
from dualdrive.sweeps import sweep

MOTION = move(0.01, v=0.03, a=0.01, j=0.05, start=1.0, end=4.5)
AXES: dict[str, Any] = {"meshes.gap": [0.0, 1.1e-3, 2.2e-3], "controller.T_ten": "0,60"}


def table() -> Machine:
    return Machine.load("heavy-table-250t")


def swept_file(folder: Path) -> Path:
    """Finished, with one signal kept whole."""
    path = folder / "sweep.h5"
    sweep(table(), AXES, motion=MOTION, output=path, keep=["theta_m"], command="as typed").close()
    return path
