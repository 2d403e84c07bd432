"""python -m tests.blind run --cases DIR/cases --shard 1/4 --budget 600 -o RESULTS

Diagnoses every case of a folder, one process each, and writes one JSON file per case. What stands
there already is skipped, so that a run can be stopped and taken up again, or be shared out.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

#: a case that takes so many times its budget is ended
PATIENCE = 3.0
_POLL = 0.05


@dataclass(frozen=True)
class Task:
    """One case: where it lies, where its result goes, seconds it may take, and who does it."""

    folder: Path
    result: Path
    budget: float
    diagnose: str


def main(arguments: Sequence[str]) -> int:
    """Diagnose the cases of a suite."""
    parser = argparse.ArgumentParser(prog="tests.blind run", description=main.__doc__)
    parser.add_argument("--cases", type=Path, required=True, help="folder of case folders")
    parser.add_argument("--shard", default="1/1", help="which part of how many: 1/4")
    parser.add_argument("--budget", type=float, default=float("inf"), help="s in all")
    parser.add_argument("--case-budget", type=float, default=30.0, help="s for each case")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--with", dest="diagnose", default="dualdrive.diagnose:diagnose")
    parser.add_argument("-o", "--output", type=Path, required=True)
    told = parser.parse_args(arguments)
    part, parts = (int(n) for n in told.shard.split("/"))
    folders = sorted(f for f in told.cases.iterdir() if (f / "case.json").exists())
    told.output.mkdir(parents=True, exist_ok=True)
    tasks = [
        Task(f, told.output / f"{f.name}.json", told.case_budget, told.diagnose)
        for f in folders[part - 1 :: parts]
    ]
    left = run([t for t in tasks if not t.result.exists()], told.budget, told.jobs)
    print(f"{len(tasks) - left} of {len(tasks)} cases have a result in {told.output}")
    return 0 if left == 0 else 1


def run(tasks: list[Task], budget: float, jobs: int, tell: Callable[[str], None] = print) -> int:
    """Work through the tasks; how many were left undone when the budget was spent."""
    if tasks:
        import_module(tasks[0].diagnose.split(":")[0])  # once, before the processes branch off
    context = multiprocessing.get_context("fork")
    waiting, running = list(tasks), list[tuple[Task, BaseProcess, float]]()
    end = time.monotonic() + budget
    while running or (waiting and time.monotonic() < end):
        while waiting and len(running) < jobs and time.monotonic() < end:
            task = waiting.pop(0)
            process = context.Process(target=work, args=(task,))
            process.start()
            running.append((task, process, time.monotonic()))
        time.sleep(_POLL)
        running = [one for one in running if not _over(*one, tell)]
    return len(waiting)


def _over(task: Task, process: BaseProcess, began: float, tell: Callable[[str], None]) -> bool:
    """Whether that case is through; one that hangs or dies is recorded as such."""
    took = time.monotonic() - began
    if process.is_alive():
        if took < PATIENCE * task.budget + 10:
            return False
        process.kill()
        process.join()
        failed(task, f"ended after {took:.0f} s", took)
    process.join()
    if not task.result.exists():
        failed(task, f"its process ended with {process.exitcode} and no result", took)
    tell(f"{task.folder.name} {took:.1f} s")
    return True


def work(task: Task) -> None:
    """One case, in a process of its own."""
    began = time.monotonic()
    try:
        figures = diagnosed(task)
    except Exception:  # whatever it is, it is this case's result
        failed(task, traceback.format_exc(), time.monotonic() - began)
        return
    took = time.monotonic() - began
    store(task.result, {"case": task.folder.name, "seconds": took, "diagnosis": figures})


def diagnosed(task: Task) -> dict[str, Any]:
    """Figures of the diagnosis, from nothing but what the case's folder holds."""
    from dualdrive import Machine
    from dualdrive.traces import read

    known = json.loads((task.folder / "case.json").read_text())
    machine = Machine.load(str(task.folder / known["machine"]))
    traces = [read(str(task.folder / name)) for name in known["records"]]
    module, name = task.diagnose.split(":")
    diagnose = getattr(import_module(module), name)
    found = diagnose(machine, traces, settings=known["settings"], mode="auto", budget=task.budget)
    figures: dict[str, Any] = found.figures()
    return figures


def failed(task: Task, why: str, took: float) -> None:
    """The result of a case that has none."""
    store(task.result, {"case": task.folder.name, "seconds": took, "failed": why})


def store(path: Path, figures: dict[str, Any]) -> None:
    """Write whole or not at all."""
    fresh = path.with_suffix(".fresh")
    fresh.write_text(json.dumps(figures, indent=1, default=float) + "\n")
    fresh.replace(path)
