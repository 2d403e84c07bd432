"""Computations as processes of their own, each with a folder; a lost server loses none of them.

    jobs/0007/request.json   what to do
              events.jsonl   how far it is, a line each
              done.json      how it ended, written last
              lock           held as long as the process lives, with its number

A process that has loaded everything forks for each, so that a computation begins at once. It has a
session of its own: neither Ctrl-C nor the end of the server reaches it, and the next server finds
it by its lock.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dualdrive.files import write_atomically
from dualdrive.workbench.limits import GRACE, MOST_JOBS

__all__ = ["Job", "Jobs", "begin"]


@dataclass(frozen=True)
class Job:
    """One computation, as its folder tells of it."""

    folder: Path

    @property
    def number(self) -> int:
        """As the folder is called."""
        return int(self.folder.name)

    @property
    def request(self) -> dict[str, Any]:
        """What to do: kind, title and arguments."""
        found: dict[str, Any] = json.loads((self.folder / "request.json").read_text("utf-8"))
        return found

    @property
    def done(self) -> dict[str, Any] | None:
        """How it ended: ``ok``, ``message``; None while it has not."""
        try:
            found: dict[str, Any] = json.loads((self.folder / "done.json").read_text("utf-8"))
        except FileNotFoundError:
            return None
        return found

    def events(self) -> list[dict[str, Any]]:
        """Everything it has told of its progress."""
        with contextlib.suppress(FileNotFoundError):
            lines = (self.folder / "events.jsonl").read_text("utf-8").split("\n")
            return [json.loads(line) for line in lines[:-1]]
        return []

    def owner(self) -> int | None:
        """The process that computes it, None where there is none."""
        try:
            file = os.open(self.folder / "lock", os.O_RDWR | os.O_CLOEXEC)
        except FileNotFoundError:
            return None
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return int(os.read(file, 20) or 0) or None
        finally:
            os.close(file)
        return None

    def end(self, message: str, *, stopped: bool = False) -> None:
        """Note that it ended without a result, unless it ended by itself."""
        if self.done is None:
            told = {"ok": False, "stopped": stopped, "message": message}
            with write_atomically(self.folder / "done.json") as temporary:
                temporary.write_text(json.dumps(told), "utf-8")


class Jobs:
    """The jobs of a project."""

    def __init__(self, folder: Path, worker: subprocess.Popen[bytes] | None = None) -> None:
        self.folder = folder
        folder.mkdir(exist_ok=True)
        self._worker = worker
        self._sent: set[int] = set()
        self._next = max((int(p.name) for p in self._folders()), default=0) + 1

    def _folders(self) -> Iterator[Path]:
        return (p for p in self.folder.iterdir() if p.name.isdecimal())

    def __getitem__(self, number: int) -> Job:
        return Job(self.folder / f"{number:04d}")

    def prepare(self) -> subprocess.Popen[bytes]:
        """Have the process ready from which jobs are forked."""
        if self._worker is None or self._worker.poll() is not None:
            self._sent.clear()
            self._worker = begin()
        return self._worker

    def start(self, kind: str, title: str, arguments: Mapping[str, Any]) -> Job:
        """Begin a job."""
        job = self[self._next]
        self._next += 1
        job.folder.mkdir()
        request = {"kind": kind, "title": title, **arguments}
        with write_atomically(job.folder / "request.json") as temporary:
            temporary.write_text(json.dumps(request), "utf-8")
        worker = self.prepare()
        assert worker.stdin is not None
        try:
            worker.stdin.write(os.fsencode(job.folder.absolute()) + b"\n")
            worker.stdin.flush()
            self._sent.add(job.number)
        except BrokenPipeError:
            job.end("the computing process could not be started")
        return job

    def alive(self, job: Job) -> bool:
        """Whether it is still computing; one that was lost is noted as ended."""
        if job.done is not None:
            return False
        # in this order: a lock that appears between the two is held from the first moment
        if self._starting(job) or job.owner() is not None:
            return True
        if job.done is None:
            job.end("the computation ended without a result: killed, or out of memory; try again")
        return False

    def _starting(self, job: Job) -> bool:
        """Whether it was sent, and its process has not taken its lock yet."""
        sent = job.number in self._sent and not (job.folder / "lock").exists()
        return sent and self._worker is not None and self._worker.poll() is None

    def cancel(self, job: Job, *, keep: bool = False) -> None:
        """Stop a job; `keep` lets it take its time and hand over what it knows."""
        threading.Thread(target=self._stop, args=(job, keep), daemon=True).start()

    def _stop(self, job: Job, keep: bool) -> None:
        end = time.monotonic() + GRACE
        while (owner := job.owner()) is None and time.monotonic() < end and job.done is None:
            time.sleep(0.01)
        if not keep:
            job.end("cancelled; nothing was changed", stopped=True)  # what comes now is late
        with contextlib.suppress(ProcessLookupError):
            if owner is not None:
                os.kill(owner, signal.SIGINT)
        while not keep and time.monotonic() < end and job.owner() == owner:
            time.sleep(0.02)
        if not keep and owner is not None and job.owner() == owner:  # its lock says it is the same
            with contextlib.suppress(ProcessLookupError):
                os.kill(owner, signal.SIGKILL)

    def forget(self, needed: set[int]) -> None:
        """Delete the oldest results that nothing rests on, where there are too many."""
        import shutil

        numbers = sorted(int(p.name) for p in self._folders())
        spare = [n for n in numbers if n not in needed]
        for n in spare[: max(0, len(numbers) - MOST_JOBS)]:
            shutil.rmtree(self[n].folder, ignore_errors=True)

    def close(self) -> None:
        """Let go of the process from which jobs are forked; jobs under way go on."""
        if self._worker is not None:
            assert self._worker.stdin is not None
            self._worker.stdin.close()
            self._worker.wait()
            self._worker = None


def begin() -> subprocess.Popen[bytes]:
    """A process that forks for every folder of a job on its standard input."""
    own = {"OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
    return subprocess.Popen(
        [sys.executable, "-m", "dualdrive.workbench.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        env={**os.environ, **own},
        start_new_session=True,
    )
