"""A Ctrl-C that loses no run under way."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_log = logging.getLogger(__name__)

__all__ = ["finishing", "interrupt"]

#: the events of the calls under way
_under_way: list[threading.Event] = []


class _First:
    """What the first Ctrl-C does: sets its event, and those of the calls around it."""

    def __init__(self, stop: threading.Event) -> None:
        self.stop = stop
        self.before: Any = signal.signal(signal.SIGINT, self)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.stop.set()
        if isinstance(self.before, _First):
            self.before(number, frame)
            return
        signal.signal(signal.SIGINT, self.before)
        _log.warning("finishing the runs under way; Ctrl-C again ends at once")


@contextmanager
def interrupt() -> Iterator[threading.Event]:
    """Give an event that the first Ctrl-C sets; the second one does what it did before.

    Inside another such call the first Ctrl-C sets the events of both; where that one has heard it
    already, the event is set from the first, and a second Ctrl-C stays the second. Outside the main
    thread, where Python delivers no signals, the event is never set.
    """
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    if finishing():  # heard by a call around this one, before it came here
        stop.set()
        yield stop
        return
    first = _First(stop)
    _under_way.append(stop)
    try:
        yield stop
    finally:
        _under_way.remove(stop)
        outermost = first.before
        while stop.is_set() and isinstance(outermost, _First):
            outermost = outermost.before
        signal.signal(signal.SIGINT, outermost)


def finishing() -> bool:
    """Whether a first Ctrl-C was heard, and what is under way is being finished."""
    return any(stop.is_set() for stop in _under_way)
