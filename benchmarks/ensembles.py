"""Many runs of the case with many impacts: how fast, on how many cores, in how much memory.

    python benchmarks/ensembles.py               a thousand runs of each kind: about a minute
    python benchmarks/ensembles.py --runs 100    fewer
    python benchmarks/ensembles.py --write       and the table into docs/performance.md

Every run has another half-gap. Targets are wall clock on two cores that do nothing else; the
processor time per thread beside it is what such cores would take at least. With
DUALDRIVE_KERNELS=baseline in the environment the inner loops are those that any x86-64 runs.
Traces go to an HDF5 file in the folder for temporary files (TMPDIR), which needs room for them.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import case
import core_machines
import page
import report
import surroundings
from dualdrive import Machine, _core, ensemble, load_sweep, sweep
from dualdrive.ensembles import Ensemble
from dualdrive.motion import Motion, sine

#: kept whole in the file: the eight states of Eq. 23, following error and both torques
TRACES = ("theta_m", "omega_m", "theta_c1", "theta_c2", "omega_c1", "omega_c2", "I_1", "I_2", "e",
          "T_1", "T_2")  # fmt: skip
GAPS = (3e-4, 7e-4)  # rad, half-gaps
RUNS, CORES = 1000, 2
REPEATS = 3


@dataclass(frozen=True)
class Row:
    """What was done, and how long it took: wall clock and processor time of all threads, s.

    limit: s of wall clock that it may take on quiet cores, for `RUNS` runs; None: no target
    """

    what: str
    runs: int
    jobs: int
    wall: float
    processor: float
    limit: float | None = None
    note: str = ""

    @property
    def per_run(self) -> float:
        """Processor ms of a run."""
        return 1e3 * self.processor / self.runs

    @property
    def per_core(self) -> float:
        """Processor time of each core, s: the wall clock of cores that do nothing else."""
        return self.processor / self.jobs


def machine() -> Machine:
    """The case as a machine with a file of its own."""
    core = core_machines.core_machine(case.machine())
    found = Machine.load("heavy-table-empty")
    for label in found.effects:
        found.remove(label)
    for choice in ("equaliser", "current"):
        found.set(f"controller.{choice}", core.controller_options[choice])
    for parameter in core.parameters():
        found.core.set(parameter.path, parameter.value)
    found.name = f"case-{case.VARIANT}"
    return found


def motion() -> Motion:
    return sine(case.AMPLITUDE, case.FREQUENCY, end=case.SPAN)


def begin(runs: int, jobs: int, end: float = case.SPAN, **options: Any) -> Ensemble:
    gaps = {"meshes.gap": np.linspace(*GAPS, runs)}
    return ensemble(machine(), motion(), gaps, end=end, jobs=jobs, **options)


def timed(what: str, runs: int, jobs: int, do: Callable[[], Any], **more: Any) -> Row:
    """The best of some repeats: other work on the machine only ever adds."""
    found = []
    for _ in range(REPEATS):
        wall, processor = time.perf_counter(), time.process_time()
        do()
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        found.append((wall, processor))
    wall, processor = (min(column) for column in zip(*found, strict=True))
    return Row(what, runs, jobs, wall, processor, **more)


# --- what is measured -----------------------------------------------------------------------------


def rows(runs: int = RUNS) -> list[Row]:
    cores = min(CORES, len(os.sched_getaffinity(0)))
    found = [overhead(5 * runs, 1)]
    figures = [summaries(runs, jobs) for jobs in range(1, cores + 1)]
    found += [row for row, _ in figures]
    assert len({bits for _, bits in figures}) == 1, "figures depend on the number of threads"
    found.append(with_balance(runs, cores))
    found += [into_file(runs, cores), into_file(runs, cores, TRACES)]
    return [*found, *memory(runs, cores)]


def overhead(runs: int, jobs: int) -> Row:
    """All that is not integration: runs of one output step."""

    def do() -> None:
        assert all(one.status == "success" for one in begin(runs, jobs, end=1e-3, energy=False))

    return timed("1 ms each: set-up and summary", runs, jobs, do)


def summaries(runs: int, jobs: int) -> tuple[Row, bytes]:
    """The row, and all figures but the measured speed as bytes."""
    found = np.empty((0, 0))

    def do() -> None:
        nonlocal found
        under_way = begin(runs, jobs, energy=False)
        taken = {one.run: one.figures for one in under_way}
        names = [name for name in under_way.names if name != "speed"]
        found = np.array([[taken[k][name] for name in names] for k in range(runs)])
        assert np.isfinite(found[:, names.index("rms_error")]).all(), "a run failed"

    limit = 1.5 if jobs == CORES else None
    row = timed(f"{case.SPAN:g} s each, figures", runs, jobs, do, limit=limit)
    return row, found.tobytes()


def with_balance(runs: int, jobs: int) -> Row:
    def do() -> None:
        assert all(one.status == "success" for one in begin(runs, jobs))

    return timed(f"{case.SPAN:g} s each, figures and balance of energy", runs, jobs, do)


def into_file(runs: int, jobs: int, keep: tuple[str, ...] = ()) -> Row:
    """A sweep, on the disk when it returns."""
    axes = {"meshes.gap": np.linspace(*GAPS, runs)}
    with tempfile.TemporaryDirectory(prefix="dualdrive-") as folder:
        path = Path(folder) / "sweep.h5"

        def do() -> None:
            path.unlink(missing_ok=True)
            sweep(machine(), axes, motion=motion(), jobs=jobs, output=path, keep=keep,
                  energy=False).close()  # fmt: skip

        what = f"{len(keep)} traces into HDF5" if keep else "into HDF5"
        row = timed(f"{case.SPAN:g} s each, figures, {what}", runs, jobs, do, limit=2.0)
        with load_sweep(path) as found:
            assert not found.failed, "a run failed"
        return replace(row, note=f"{path.stat().st_size / 1e6:.0f} MB")


def memory(runs: int, jobs: int) -> Iterator[Row]:
    """Peak memory of a process with few runs and with many, traces handed over one by one."""
    for count in (max(1, runs // 5), 2 * runs):
        command = [sys.executable, __file__, "--peak", str(count), str(jobs)]
        done = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        wall, processor, peak = map(float, done.split())
        what = f"{case.SPAN:g} s each, {len(TRACES)} traces taken one by one"
        yield Row(what, count, jobs, wall, processor, note=f"peak {peak:.0f} MB")


def peak(runs: int, jobs: int) -> None:
    wall, processor = time.perf_counter(), time.process_time()
    for one in begin(runs, jobs, keep=TRACES, energy=False):
        assert one.status == "success"
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(wall, processor, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


# --- how it is told -------------------------------------------------------------------------------


def text(found: list[Row]) -> str:
    head = ("what", "runs", "threads", "wall s", "processor s per thread", "ms per run", "target s",
            "")  # fmt: skip
    lines = [
        (
            row.what,
            str(row.runs),
            str(row.jobs),
            f"{row.wall:.2f}",
            f"{row.per_core:.2f}",
            f"{row.per_run:.3f}",
            "" if row.limit is None else f"{row.limit * row.runs / RUNS:g}",
            row.note,
        )
        for row in found
    ]
    return "\n".join([str(report.table(head, lines)), "", *summary(found)])


def scaling(found: list[Row]) -> tuple[float, float] | None:
    """How many times as fast two threads are: by the wall clock, and by what a run costs there."""
    alone, both = ([row for row in found if row.jobs == jobs] for jobs in (1, CORES))
    for one in alone:
        for other in both:
            if (one.what, one.runs) == (other.what, other.runs):
                return one.wall / other.wall, CORES * one.processor / other.processor
    return None


def summary(found: list[Row]) -> list[str]:
    lines = []
    if times := scaling(found):
        lines.append(
            f"Two threads are {times[0]:.2f} times as fast as one by the clock, {times[1]:.2f} by "
            "processor time (target 1.9)."
        )
    peaks = [f"{row.note} with {row.runs} runs" for row in found if row.note.startswith("peak")]
    lines.append(f"Memory: {', '.join(peaks)} (target: the same).")
    lines.append(f"Inner loops of the exact engine: {_core.__kernels__}.")
    return lines


def as_json(found: list[Row]) -> str:
    return json.dumps(
        {
            "surroundings": surroundings.describe(),
            "rows": [asdict(row) for row in found],
            "scaling": scaling(found),
        },
        indent=2,
    )


def main() -> None:
    parser = page.command_line(str(__doc__))
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--json", metavar="FILE|-", help="figures as JSON; - to standard output")
    parser.add_argument("--peak", type=int, nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.peak:
        return peak(*given.peak)
    found = rows(given.runs)
    if given.json != "-":
        print(text(found))
    if given.json == "-":
        print(as_json(found))
    elif given.json:
        Path(given.json).write_text(as_json(found) + "\n", "utf-8")
    if given.write:
        page.write("ensembles", text(found))
    return None


if __name__ == "__main__":
    main()
