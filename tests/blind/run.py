"""python -m tests.blind run DIR --jobs 2 [-o RESULTS] [-- --effort quick]

Runs `dualdrive diagnose` on every case of a folder, one process each, and writes one JSON file per
case. What stands there already is skipped, so that a run can be stopped and taken up again.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Task:
    """One case: where it lies, where its result goes, the command before its files, its end, s."""

    folder: Path
    result: Path
    command: tuple[str, ...]
    more: tuple[str, ...]
    patience: float


def main(arguments: Sequence[str]) -> int:
    """Diagnose the cases of a folder; what follows -- goes to every diagnosis."""
    own, more = list(arguments), []
    if "--" in own:
        at = own.index("--")
        own, more = own[:at], own[at + 1 :]
    parser = argparse.ArgumentParser(prog="tests.blind run", description=main.__doc__)
    parser.add_argument("folder", type=Path, help="as `generate` wrote it")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--patience", type=float, default=1800.0, help="s until a case is ended")
    parser.add_argument("--only", default="", help="cases whose name holds this")
    parser.add_argument("--with", dest="command", default="", help="instead of dualdrive diagnose")
    parser.add_argument("-o", "--output", type=Path, help="RESULTS; DIR/results unless given")
    told = parser.parse_args(own)
    output = told.output or told.folder / "results"
    output.mkdir(parents=True, exist_ok=True)
    command = tuple(told.command.split()) or (dualdrive(), "diagnose")
    tasks = [
        Task(case, output / f"{case.name}.json", command, tuple(more), told.patience)
        for case in sorted((told.folder / "cases").iterdir())
        if (case / "case.json").exists() and told.only in case.name
    ]
    run([task for task in tasks if not task.result.exists()], told.jobs)
    done = sum(task.result.exists() for task in tasks)
    print(f"{done} of {len(tasks)} cases have a result in {output}")
    return int(done < len(tasks))


def dualdrive() -> str:
    """The program beside this Python."""
    beside = Path(sys.executable).with_name("dualdrive")
    return str(beside) if beside.exists() else shutil.which("dualdrive") or "dualdrive"


def run(tasks: list[Task], jobs: int, tell: Callable[[str], None] = print) -> None:
    """Work through the tasks."""
    with ThreadPoolExecutor(jobs) as pool:
        for said in pool.map(work, tasks):
            tell(said)


def work(task: Task) -> str:
    """One case, in a process of its own, from nothing but what its folder holds."""
    began = time.monotonic()
    answer = task.result.with_suffix(".answer")
    answer.unlink(missing_ok=True)
    row: dict[str, Any] = {"case": task.folder.name}
    try:
        done = subprocess.run(
            [*task.command, *files(task.folder), *task.more, "--json", str(answer)],
            capture_output=True,
            text=True,
            timeout=task.patience,
            check=False,
        )
        row["exit"] = done.returncode
        row["said"] = (done.stderr.strip() or done.stdout.strip())[-400:]
    except subprocess.TimeoutExpired:
        row["failed"] = f"ended after {task.patience:.0f} s"
    row["seconds"] = time.monotonic() - began
    if answer.exists() and "failed" not in row:
        row["diagnosis"] = json.loads(answer.read_text())
    else:
        row.setdefault("failed", f"exit {row.get('exit')}: {row.get('said', '')}")
    answer.unlink(missing_ok=True)
    store(task.result, row)
    return f"{task.folder.name} {row['seconds']:.1f} s {row.get('failed', '')[:120]}".rstrip()


def files(folder: Path) -> list[str]:
    """Machine, records and the settings of each, as they stand on a command line."""
    known = json.loads((folder / "case.json").read_text())
    said = [str(folder / known["machine"]), *(str(folder / name) for name in known["records"])]
    for name, settings in known.get("settings", {}).items():
        for key, value in settings.items():
            said += ["--set-for", f"{name}:{key}={value!r}"]
    return said


def store(path: Path, figures: dict[str, Any]) -> None:
    """Write whole or not at all."""
    fresh = path.with_suffix(".fresh")
    fresh.write_text(json.dumps(figures, indent=1, default=float) + "\n")
    fresh.replace(path)
