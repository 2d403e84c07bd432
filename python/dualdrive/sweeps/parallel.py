"""Work spread over threads, results handed back as they finish, and a Ctrl-C that loses none."""

from __future__ import annotations

import logging
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from types import FrameType
from typing import TypeVar

_log = logging.getLogger(__name__)

__all__ = ["as_finished", "cores", "interrupt"]

Job = TypeVar("Job")
Result = TypeVar("Result")


def cores() -> int:
    """The number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def as_finished(
    do: Callable[[Job], Result], jobs: Iterable[Job], threads: int, stop: threading.Event
) -> Iterator[list[Result]]:
    """Yield results in batches, in the order in which they finish.

    At most two jobs per thread are under way or waiting to be handed over, so that memory stays
    bounded however many there are. When `stop` is set no job is begun any more, and those under
    way are still handed over. An exception of a job is raised here.
    """
    waiting = iter(jobs)
    with ThreadPoolExecutor(threads, thread_name_prefix="sweep") as pool:
        try:
            running: set[Future[Result]] = set()
            while True:
                if not stop.is_set():
                    room = 2 * threads - len(running)
                    running |= {pool.submit(do, job) for job in islice(waiting, room)}
                elif running:
                    running = {future for future in running if not future.cancel()}
                if not running:
                    return
                done, running = wait(running, return_when=FIRST_COMPLETED)
                yield [future.result() for future in done]
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def interrupt() -> Iterator[threading.Event]:
    """Give an event that the first Ctrl-C sets; the second one does what it did before.

    Outside the main thread, where Python delivers no signals, the event is never set.
    """
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def first(number: int, frame: FrameType | None) -> None:
        stop.set()
        signal.signal(signal.SIGINT, before)
        _log.warning("finishing the runs under way; Ctrl-C again ends at once")

    before = signal.signal(signal.SIGINT, first)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)
