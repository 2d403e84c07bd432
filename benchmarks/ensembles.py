"""Many runs of the case with many impacts: how fast, on how many cores, in how much memory.

    python benchmarks/ensembles.py              a thousand runs of each kind
    python benchmarks/ensembles.py --runs 100   fewer

Every run has another half-gap. Times are wall clock: they need a quiet machine. Traces go to an
HDF5 file in the folder for temporary files (TMPDIR), which needs room for them.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import case
import core_machines
import report
from dualdrive import Machine, ensemble, load_sweep, sweep
from dualdrive.ensembles import Ensemble
from dualdrive.motion import Motion, sine

#: kept whole in the file: the eight states of Eq. 23, following error and both torques
TRACES = ("theta_m", "omega_m", "theta_c1", "theta_c2", "omega_c1", "omega_c2", "I_1", "I_2", "e",
          "T_1", "T_2")  # fmt: skip
GAPS = (3e-4, 7e-4)  # rad, half-gaps
RUNS = 1000


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


def rows(runs: int = RUNS) -> list[dict[str, Any]]:
    """One row per kind of ensemble and number of threads; see `row`."""
    counts = range(1, len(os.sched_getaffinity(0)) + 1)
    found = [overhead(jobs) for jobs in counts]
    found += [summaries(runs, jobs) for jobs in counts]
    bits = {one.pop("bits") for one in found if "bits" in one}
    assert len(bits) == 1, "figures depend on the number of threads"
    found += [into_file(runs, jobs) for jobs in counts]
    return [*found, *memory(runs)]


def row(what: str, runs: int, jobs: int, wall: float, **more: Any) -> dict[str, Any]:
    """What was done, and per run: wall clock and, in `note`, what else there is to say."""
    return {
        "what": what,
        "runs": runs,
        "jobs": jobs,
        "wall_s": wall,
        "ms_per_run": 1e3 * wall / runs,
        **more,
    }


def overhead(jobs: int, runs: int = 5000) -> dict[str, Any]:
    """All that is not integration: runs of one output step."""
    start = time.perf_counter()
    assert all(one.status == "success" for one in begin(runs, jobs, end=1e-3))
    return row("1 ms each: set-up and summary", runs, jobs, time.perf_counter() - start)


def summaries(runs: int, jobs: int) -> dict[str, Any]:
    start = time.perf_counter()
    under_way = begin(runs, jobs)
    found = {one.run: one.figures for one in under_way}
    wall = time.perf_counter() - start
    names = [name for name in under_way.names if name != "speed"]
    bits = np.array([[found[k][name] for name in names] for k in range(runs)])
    assert np.isfinite(bits[:, names.index("rms_error")]).all(), "a run failed"
    return row(f"{case.SPAN:g} s each, figures alone", runs, jobs, wall, bits=bits.tobytes())


def into_file(runs: int, jobs: int) -> dict[str, Any]:
    """A sweep with every trace in its file, on the disk when it returns."""
    with tempfile.TemporaryDirectory(prefix="dualdrive-") as folder:
        path = Path(folder) / "sweep.h5"
        start = time.perf_counter()
        axes = {"meshes.gap": np.linspace(*GAPS, runs)}
        sweep(machine(), axes, motion=motion(), jobs=jobs, output=path, keep=TRACES).close()
        wall = time.perf_counter() - start
        with load_sweep(path) as found:
            assert not found.failed, "a run failed"
        size = path.stat().st_size / 1e6
    what = f"{case.SPAN:g} s each, {len(TRACES)} traces into HDF5"
    return row(what, runs, jobs, wall, note=f"{size:.0f} MB, {size / wall:.0f} MB/s")


def memory(runs: int) -> Iterator[dict[str, Any]]:
    """Peak memory of a process with few runs and with many, traces handed over one by one."""
    for count in (max(1, runs // 10), 2 * runs):
        start = time.perf_counter()
        command = [sys.executable, __file__, "--peak", str(count)]
        peak = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        wall = time.perf_counter() - start
        yield row(
            "10 s each, traces taken one by one", count, 2, wall, note=f"peak {peak.strip()} MB"
        )


def peak(runs: int) -> None:
    for one in begin(runs, 2, keep=TRACES):
        assert one.status == "success"
    print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.1f}")


def text(found: list[dict[str, Any]]) -> str:
    """A table of the rows, with the speed-up over one thread."""
    alone = {one["what"]: one["ms_per_run"] for one in found if one["jobs"] == 1}
    lines = []
    for one in found:
        speed_up = alone.get(one["what"], np.nan) / one["ms_per_run"]
        times = f"{speed_up:.2f}" if one["what"] in alone else ""
        lines.append((one["what"], str(one["runs"]), str(one["jobs"]), f"{one['wall_s']:.2f}",
                      f"{one['ms_per_run']:.3f}", times, one.get("note", "")))  # fmt: skip
    head = ("what", "runs", "threads", "wall s", "ms per run", "speed-up", "")
    return str(report.table(head, lines))


def main() -> None:
    about, _, rest = str(__doc__).partition("\n\n")
    parser = argparse.ArgumentParser(
        description=about, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--peak", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.peak:
        peak(given.peak)
    else:
        print(text(rows(given.runs)))


if __name__ == "__main__":
    main()
