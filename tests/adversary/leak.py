"""python -m tests.adversary.leak [--runs N]

Memory, threads and open files of one process that does the same work again and again: runs by each
engine, gradients, refusals. The first half makes whatever is made once; the second may add nothing.
"""

from __future__ import annotations

import argparse
import contextlib
import resource
import threading
from collections.abc import Callable
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from typing import Final

import numpy as np

import dualdrive
from dualdrive import Machine, _core
from dualdrive.motion import parse_motion

END = 0.02  # s of a run
GROWTH = 2.0**20  # bytes that the second half may add to the peak: less than 110 a run of 10,000
MOTION = "sine:1mrad,f=20,end=0.02"


MACHINE: Final = Machine.load("bench")
INPUTS: Final = {"theta_ref": _core.sine(1e-3, 20.0)}


def simulated(engine: str) -> None:
    """A short run, each of a machine of its own."""
    machine = MACHINE.copy()
    machine.add("coulomb", "table", torque=0.1)
    dualdrive.simulate(machine, parse_motion(MOTION), engine=engine, output_step=1e-3)


def differentiated() -> None:
    """The gradient of a run, taken back through its switches."""
    found = _core.simulate(MACHINE.core, INPUTS, end=END, signals=["e"], gradient=["table.J"])
    found.pull_back(np.ones_like(found.values))


def refused() -> None:
    """What makes no sense, and a formula that ends in infinity."""
    for wrong in ({"table.J": "-1"}, {"table.J": "1 kg^9^9"}, {"tabel.J": "1"}):
        with contextlib.suppress(ValueError):
            MACHINE.copy().set(*wrong.popitem())
    with contextlib.suppress(ValueError):
        parse_motion("sine:1mrad,f=20,ned=1")
    machine = MACHINE.core.copy()
    machine.add_expression("table", "a / (t - t)", [("a", "N*m", 1.0)])
    _core.simulate(machine, INPUTS, end=END)


KINDS: Final[tuple[Callable[[], None], ...]] = (
    *(partial(simulated, engine) for engine in ("exact", "cvode", "explicit")),
    differentiated,
    refused,
)


def main() -> int:
    """Print what grew; 1 where it is too much."""
    parser = argparse.ArgumentParser(prog="python -m tests.adversary.leak", description=__doc__)
    parser.add_argument("--runs", type=int, default=20_000)
    runs = parser.parse_args().runs
    work = cycle(KINDS)
    for kind in islice(work, runs // 2):
        kind()
    before = state()
    for kind in islice(work, runs - runs // 2):
        kind()
    after = state()
    print(f"{'runs':>7} {'peak MB':>8} {'grown kB':>9} {'threads':>8} {'files':>6}")
    print(
        f"{runs:>7} {after[0] / 1e6:>8.1f} {(after[0] - before[0]) / 1e3:>9.1f} {after[1]:>8} {after[2]:>6}"
    )
    return int(after[0] - before[0] > GROWTH or after[1:] != before[1:])


def state() -> tuple[float, int, int]:
    """Most memory in use so far, bytes; threads; open files."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0
    return peak, threading.active_count(), len(list(Path("/proc/self/fd").iterdir()))


if __name__ == "__main__":
    raise SystemExit(main())
