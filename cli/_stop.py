"""Ctrl-C and SIGTERM, from the first moment to the last.

Imported before anything else, so it imports next to nothing. While modules load and while the
interpreter shuts down there is nothing to save, and the process ends at once; a verb under way gets
KeyboardInterrupt, and ends in good order.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

STOPPED, TERMINATED = 130, 143  # 128 and the number of the signal, as shells have it


class Guard:
    """The handler of both signals.

    running:  a verb is under way; it catches KeyboardInterrupt
    pressed:  it was raised; what fails after that fails because of it
    code:     with which a stopped command ends
    release:  gives up what the process holds on the disk; for an end without Python's own
    """

    def __init__(self) -> None:
        self.running = self.pressed = False
        self.code = STOPPED
        self.release: Callable[[], object] | None = None

    def stand(self) -> None:
        """Begin; a Ctrl-C that the shell wants ignored stays ignored."""
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, self)
        signal.signal(signal.SIGTERM, self._terminate)
        signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
        sys.unraisablehook = self._swallowed
        # last of all, when everything is written: the interpreter is about to drop its handlers
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if not self.running or _finishing():
            self.end_at_once()
        self.pressed = True
        raise KeyboardInterrupt

    def _terminate(self, number: int, frame: FrameType | None) -> None:
        """Whatever Ctrl-C would do now, with another exit code."""
        self.code = TERMINATED
        if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
            self(number, frame)
        signal.raise_signal(signal.SIGINT)

    def _swallowed(self, lost: sys.UnraisableHookArgs) -> None:
        """Where it was raised in a destructor, from which nothing can be raised: once more."""
        if issubclass(lost.exc_type, KeyboardInterrupt) and self.running:
            signal.setitimer(signal.ITIMER_REAL, 0.01)  # out of here, where it would be lost again
        elif not self.pressed:  # what was half made when it came can't be taken down in order
            sys.__unraisablehook__(lost)

    def end_at_once(self) -> None:
        """Without another line of Python: what is half imported would fail in words of its own."""
        os.write(2, b"dualdrive: stopped\n")
        try:
            if self.release is not None:
                self.release()
        finally:
            os._exit(self.code)


def _finishing() -> bool:
    """Whether this is the second Ctrl-C: the first one has asked to finish what is under way."""
    interrupt = sys.modules.get("dualdrive.interrupt")
    return interrupt is not None and bool(interrupt.finishing())


guard = Guard()
