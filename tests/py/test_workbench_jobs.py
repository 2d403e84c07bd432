"""A computation of the workbench is lost only when its process is."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from dualdrive.workbench.jobs import Job, Jobs


@pytest.fixture
def jobs(tmp_path: Path) -> Iterator[Jobs]:
    """A project's jobs, and a worker that takes their folders and computes nothing."""
    idle = [sys.executable, "-c", "import sys; sys.stdin.read()"]
    found = Jobs(tmp_path / "jobs", subprocess.Popen(idle, stdin=subprocess.PIPE))
    yield found
    found.close()


@dataclass(frozen=True)
class Taken(Job):
    """A job whose process takes its lock just after somebody has looked whether it had."""

    held: list[int] = field(default_factory=list)

    def owner(self) -> int | None:
        found = super().owner()
        if not self.held:
            lock = os.open(self.folder / "lock", os.O_RDWR | os.O_CREAT)
            fcntl.flock(lock, fcntl.LOCK_EX)
            os.write(lock, str(os.getpid()).encode())
            self.held.append(lock)
        return found


def test_a_lock_taken_while_one_looks_is_no_lost_computation(jobs: Jobs) -> None:
    job = Taken(jobs.start("nothing", "a test", {}).folder)
    try:
        assert jobs.alive(job)
        assert jobs.alive(job)
        job.owner()
        assert jobs.alive(job)
        assert job.done is None
    finally:
        for lock in job.held:
            os.close(lock)


def test_a_computation_whose_process_died_is_noted_as_lost(jobs: Jobs) -> None:
    job = jobs.start("nothing", "a test", {})
    assert jobs.alive(job)
    (job.folder / "lock").write_text("1")  # nobody holds it
    assert not jobs.alive(job)
    assert job.done is not None
    assert "without a result" in job.done["message"]


def test_a_computation_nobody_began_is_lost_with_the_worker(jobs: Jobs) -> None:
    job = jobs.start("nothing", "a test", {})
    jobs.close()
    assert not jobs.alive(job)


def test_what_has_ended_keeps_its_end(jobs: Jobs) -> None:
    job = jobs.start("nothing", "a test", {})
    (job.folder / "done.json").write_text(json.dumps({"ok": True}))
    assert not jobs.alive(job)
    assert job.done == {"ok": True}
