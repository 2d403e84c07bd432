"""The case in dualdrive, its presets, and how many runs a second a sweep gets."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import case
import core_machines
from case import SPAN, Array, Engine
from dualdrive import Machine, _core, default_motion, presets, simulate, sweep

PLANT = ["omega_c1", "omega_c2", "theta_c1", "theta_c2", "I_1", "I_2", "theta_m", "omega_m"]


def engines() -> list[Engine]:
    """Adams and BDF of the core, every switch located and the integrator restarted there."""
    core, inputs = (
        core_machines.core_machine(case.machine()),
        core_machines.core_inputs(case.motion()),
    )

    def run(method: str, rtol: float) -> tuple[Array, int]:
        raw = _core.simulate(
            core, inputs, end=SPAN, rtol=rtol, method=method, signals=PLANT, energy=False
        )
        if raw.status != "success":
            raise RuntimeError(raw.message)
        found = core_machines.Run(raw)
        return found.X, len(found.contacts)

    def engine(method: str, *rtols: float) -> Engine:
        name = f"dualdrive {method.replace('adams', 'Adams').replace('bdf', 'BDF')}"
        return Engine(name, rtols, lambda rtol: run(method, rtol), repeats=5)

    return [
        engine("adams", 1e-6, 1e-8, 1e-10, 1e-12),
        engine("bdf", 1e-6, 1e-8, 1e-10, 1e-12),
    ]


def preset_rows() -> list[dict[str, Any]]:
    """Every preset through its default motion, with default options: how much faster than life.

    The error is that of the default tolerance against the finest one, worst of following error and
    motor torques, each over its peak.
    """
    rows = []
    for name in presets():
        machine = Machine.load(name)
        motion = default_motion(machine)
        spent, run = _best(partial(simulate, machine, motion))
        fine = simulate(machine, motion, rtol=1e-13)
        signals = ["e", *(s for s in ("T_1", "T_2") if s in run)]
        error = max(float(np.abs(run[s] - fine[s]).max() / np.abs(fine[s]).max()) for s in signals)
        rows.append(
            {
                "preset": name,
                "simulated_s": float(run.t[-1]),
                "ms_per_s": 1e3 * spent / float(run.t[-1]),
                "times_real_time": float(run.t[-1]) / spent,
                "events": len(run.events),
                "steps": run.statistics["steps"],
                "method": run.statistics["method"],
                "error": error,
            }
        )
    return rows


def throughput(cores: int) -> list[dict[str, Any]]:
    """Runs a second, wall clock, on one core up to all: the case, and a sweep over the play."""
    core, inputs = (
        core_machines.core_machine(case.machine()),
        core_machines.core_inputs(case.motion()),
    )

    def one(_: int) -> str:
        raw = _core.simulate(core, inputs, end=SPAN, rtol=1e-8, signals=["e"], energy=False)
        return str(raw.status)

    def pool(jobs: int) -> int:
        count = 12 * jobs
        with ThreadPoolExecutor(jobs) as threads:
            assert set(threads.map(one, range(count))) == {"success"}
        return count

    def grid(jobs: int) -> int:
        with tempfile.TemporaryDirectory() as folder:
            axes = {"meshes.gap": "0:1e-3:20"}
            sweep("heavy-table-100t", axes, jobs=jobs, output=Path(folder) / "sweep.h5")
        return 20

    rows = []
    for what, work in (
        (f"impact case, {SPAN:g} s each, rtol 1e-8", pool),
        ("sweep --delta 0:1e-3:20, heavy-table-100t", grid),
    ):
        for jobs in range(1, cores + 1):
            begin, spent = time.perf_counter(), time.process_time()
            count = work(jobs)
            wall, spent = time.perf_counter() - begin, time.process_time() - spent
            rows.append(
                {
                    "what": what,
                    "jobs": jobs,
                    "runs_per_s": count / wall,
                    "ms_per_run": 1e3 * spent / count,
                    "cores_used": spent / wall,
                }
            )
    return rows


def cores() -> int:
    return len(os.sched_getaffinity(0))


def _best(do: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Processor time of the fastest repeat, and its result."""
    best, result = np.inf, None
    for _ in range(repeats):
        begin = time.process_time()
        result = do()
        best = min(best, time.process_time() - begin)
    return best, result
