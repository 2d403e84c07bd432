"""Sweeps: the same motion on many machines, summed up in a grid of figures.

import dualdrive

found = dualdrive.sweep("heavy-table-100t", {"meshes.gap": "0:1e-3:20"}, output="sweep.h5")
found.dataset["peak_error"].plot()
"""

from __future__ import annotations

from dualdrive.ensembles import PENDING, Outcome

from .executors import Executor, Threads
from .grid import ALIASES, Axis, Grid, GridError, lay_out
from .result import Sweep, load_sweep
from .sweeping import Progress, resume, sweep

__all__ = [
    "ALIASES",
    "PENDING",
    "Axis",
    "Executor",
    "Grid",
    "GridError",
    "Outcome",
    "Progress",
    "Sweep",
    "Threads",
    "lay_out",
    "load_sweep",
    "resume",
    "sweep",
]
