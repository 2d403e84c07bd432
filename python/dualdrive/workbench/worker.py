"""The process that jobs are forked from: ``python -m dualdrive.workbench.worker``.

It is told the folder of each on its standard input.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import resource
import select
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from dualdrive.files import write_atomically
from dualdrive.said import Said
from dualdrive.workbench import tasks
from dualdrive.workbench.limits import MOST_EVENTS, WORKER_MEMORY

__all__ = ["Progress", "main"]

_DONE: Final = object()
_COUNT = re.compile(r"(\d+) of (\d+)")


class Progress:
    """What a task tells while it computes: a line of ``events.jsonl`` each."""

    def __init__(self, folder: Path) -> None:
        self._file = (folder / "events.jsonl").open("a", encoding="utf-8")
        self._begin, self._lines = time.monotonic(), 0
        self._leader = ""

    def __call__(self, text: str, **more: Any) -> None:
        """Tell in words; a count ``k of n`` and what leads a search are told by themselves too."""
        self._lines += 1
        if self._lines > MOST_EVENTS:
            return
        if isinstance(text, Said):
            self._leader, text = text.leader, text.tried
        event = {"text": text, "seconds": round(time.monotonic() - self._begin, 2), **more}
        if self._leader:
            event["leader"] = self._leader
        if count := _COUNT.search(text):
            event |= {"done": int(count[1]), "of": int(count[2])}
        self._file.write(json.dumps(event) + "\n")
        self._file.flush()


def main() -> None:
    """Fork for every folder that comes, until nobody is left to send one.

    A single thread up to here, so that forking is safe; children are nobody's to wait for.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a background shell ignores it
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    loading = tasks.warm_up()
    for folder in _told(lambda: next(loading, _DONE) is not _DONE):
        if os.fork() == 0:
            try:
                _compute(folder)
            finally:
                os._exit(0)


def _told(load: Callable[[], bool]) -> Iterator[Path]:
    """Folders as they come; while none does, `load` until it says that nothing is left."""
    held, more = b"", True
    while True:
        wait = 0.0 if more else None
        if not select.select([0], [], [], wait)[0]:
            more = load()
            continue
        piece = os.read(0, 65_536)
        if not piece:
            return
        *lines, held = (held + piece).split(b"\n")
        yield from (Path(os.fsdecode(line)) for line in lines)


def _compute(folder: Path) -> None:
    """One job, from its request to ``done.json``."""
    os.setsid()
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.close(0)
    log = os.open(folder / "log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(log, 2)
    lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    fcntl.flock(lock, fcntl.LOCK_EX)
    os.write(lock, str(os.getpid()).encode())
    (folder / ".lock").rename(folder / "lock")  # held from the first moment that it is seen
    told = _ended(folder)
    if not (folder / "done.json").exists():  # cancelled in the last moment: that stands
        with write_atomically(folder / "done.json") as temporary:
            temporary.write_text(json.dumps(told, allow_nan=False), "utf-8")


def _ended(folder: Path) -> dict[str, Any]:
    request = json.loads((folder / "request.json").read_text("utf-8"))
    try:
        if request["kind"] in tasks.FOREIGN:
            resource.setrlimit(resource.RLIMIT_AS, (WORKER_MEMORY, WORKER_MEMORY))
        return {"ok": True, **tasks.TASKS[request["kind"]](folder, request, Progress(folder))}
    except KeyboardInterrupt:
        return {"ok": False, "stopped": True, "message": "cancelled; nothing was changed"}
    except MemoryError:
        return {"ok": False, "message": "it takes more memory than a computation may have here"}
    except Exception as error:  # told to a person, whatever it is
        return {"ok": False, "message": " ".join(str(error).split())}


if __name__ == "__main__":
    main()
