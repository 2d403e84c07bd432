"""A command on a terminal of its own, as a user has it: progress is seen, Ctrl-C can be pressed."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from patience import PATIENCE


class Terminal:
    """Runs a verb; its messages and its progress go to the terminal, its output to `out`."""

    def __init__(self, arguments: Sequence[str], folder: Path) -> None:
        try:
            self._own, theirs = pty.openpty()
        except OSError as error:
            pytest.skip(f"no terminal to be had: {error}")
        self.screen = ""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "dualdrive_cli", *arguments],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=theirs,
            text=True,
            env={**os.environ, "TERM": "xterm", "COLUMNS": "200"},
            preexec_fn=_as_in_a_terminal,
        )
        os.close(theirs)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        while True:
            try:
                data = os.read(self._own, 4096)
            except OSError:  # the other side is closed
                return
            self.screen += data.decode(errors="replace")

    def wait_for(self, words: str) -> None:
        """Until the words stand on the screen."""
        end = time.monotonic() + PATIENCE
        while words not in self.screen:
            if self._process.poll() is not None or time.monotonic() > end:
                self._process.kill()
                pytest.fail(f"no {words!r} within {PATIENCE:g} s on the screen:\n{self.screen}")
            time.sleep(0.05)

    def ctrl_c(self) -> None:
        """Press it once."""
        self._process.send_signal(signal.SIGINT)

    def end(self) -> tuple[int, str]:
        """(exit status, standard output) once the command is through; it is killed if it is not."""
        try:
            out, _ = self._process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            pytest.fail(f"still running {PATIENCE:g} s later; on the screen:\n{self.screen}")
        return self._process.returncode, out


def _as_in_a_terminal() -> None:
    """A background shell lets its children ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
