"""A Ctrl-C that loses no run under way."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_log = logging.getLogger(__name__)

__all__ = ["interrupt"]


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
