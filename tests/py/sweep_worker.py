"""A sweep in a process of its own, for tests that kill it: prints how many runs are done."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path
from signal import SIGKILL

import numpy as np

from dualdrive.ensembles import SPEED
from dualdrive.machine import Machine
from dualdrive.sweeps import Outcome, Sweep, lay_out, sweep
from dualdrive.sweeps.grid_file import GridFile
from dualdrive.sweeps.layout import Kept, lay_file

AXES = {"meshes.gap": "0:2mrad:20", "controller.T_ten": "0,60"}
MOTION = "move:0.01,v=0.03,a=0.01,j=0.05,start=1,end=4"


def run(path: Path, jobs: int | None = None, dies_after: int = 0) -> Sweep:
    """The sweep that is killed and completed; it kills itself soon after so many runs if asked to.

    Each time at another moment of the work, which the computer's load doesn't make a later one.
    """

    def tell(done: int, total: int, _: object) -> None:
        print(done, total, flush=True)
        if 0 < dies_after <= done:
            threading.Timer(0.003 * (dies_after % 5), os.kill, (os.getpid(), SIGKILL)).start()

    return sweep(
        "heavy-table-550t",
        AXES,
        motion=MOTION,
        jobs=jobs,
        output=path,
        resume=True,
        keep=["e"],
        progress=tell,
    )


def write_only(path: Path) -> None:
    """Results that need no computing, one after the other: nearly always in the midst of a write.

    A figure of run k is k + 1/2, the kept signal k all along.
    """
    if not path.exists():
        blank(path)
    with GridFile(path) as file:
        print("ready", flush=True)
        for k in file.pending():
            kept = {"e": np.full(20, float(k))}
            file.write([Outcome(k, {SPEED.name: k + 0.5}, "success", f"run {k}", kept)])


def blank(path: Path) -> None:
    """An empty file of 20 000 runs."""
    grid = lay_out(Machine.load(), {"meshes.gap": "0:1e-3:200", "table.J": "1e6:2e6:100"})
    attributes = {"axes": '["meshes.gap", "table.J"]', "figures": '["speed"]'}
    kept = Kept(np.linspace(0.0, 1.0, 20), [("e", "rad", "following error")])
    lay_file(path, grid, [SPEED], attributes, kept)


if __name__ == "__main__":
    verb, path, dies_after = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    if verb == "write_only":
        write_only(path)
    else:
        run(path, dies_after=dies_after)
