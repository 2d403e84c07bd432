"""One attempt at the tool, in a process of its own under limits, and what is wrong with its end.

A process is a fork of this one, in which everything heavy is loaded already. Its limits are counted
(processor time, memory), so that a runaway fails here as it would on a machine that is slower.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import resource
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

PROCESSOR = 40  # s; the slowest honest attempt takes eight
MEMORY = 4 * 2**30  # bytes that may be mapped
RESIDENT = 1.2e9  # bytes in use at once; an honest attempt takes 0.25e9
ASLEEP = 300.0  # s without an end though the processor is not used
LONGEST = 1200  # characters of one message

#: words of libraries and of Python, which are none for a user
FOREIGN = re.compile(
    r"Traceback|object has no attribute|NoneType|unsupported operand|index out of range|"
    r"not JSON compliant|incompatible function arg|could not convert string|invalid literal|"
    r"std::|nanobind|must be str|argument must be|positional argument|codec can't|Errno|"
    r"unhashable|not subscriptable|is not iterable|Exceeds the limit|standard output cannot|"
    r"embedded null|PosixPath|maximum recursion|array is too big|Warning:|truth value|too many values"
)


#: a file that says that the project's guard stands: what comes before is not the project's
_BEGUN = ".begun"
_COLD = f"""
from dualdrive_cli.__main__ import guard, main
guard.stand()
open({_BEGUN!r}, "x")
main()
"""


@dataclass(frozen=True)
class Attempt:
    """A command line, or a call, made in a folder of its own that holds `files` at first."""

    what: str
    arguments: Sequence[str] = ()
    call: Callable[[], object] | None = None
    prepare: Callable[[], object] | None = None  # puts files there, in that folder
    interrupt: float | None = None  # s until Ctrl-C, from the project's first line on
    memory: int = MEMORY  # bytes that may be mapped
    allowed: tuple[int, ...] = (0, 1, 2)
    cold: bool = False  # in an interpreter of its own, which loads everything itself

    @property
    def serves(self) -> bool:
        """Whether it may stay until somebody ends it, once it has said where it is."""
        return tuple(self.arguments[:1]) == ("workbench",)


def judge(attempt: Attempt, inputs: Path, folder: Path) -> str:
    """What is wrong with the way an attempt ends; empty where nothing is."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(inputs, folder, symlinks=True)
    before = {path.name for path in inputs.iterdir()}
    child = os.fork()
    if child == 0:
        _run(attempt, folder)
    if attempt.interrupt is not None:
        _until_it_begins(folder, child)
    status, used = _wait(child, attempt.interrupt, folder / ".stdout" if attempt.serves else None)
    wrong = _ending(attempt, status, folder)
    if used > RESIDENT:
        wrong.append(f"{used / 1e9:.1f} GB in use")
    for name in sorted(before):
        if _hash(folder / name) != _hash(inputs / name):
            wrong.append(f"{name} was changed")
    left = [path.name for path in folder.iterdir() if path.name.startswith((".record", ".new"))]
    if left:
        wrong.append(f"left behind: {', '.join(left)}")
    shutil.rmtree(folder, ignore_errors=True)
    return "; ".join(wrong)


def _ending(attempt: Attempt, status: int, folder: Path) -> list[str]:
    said = (folder / ".stderr").read_text("utf-8", "replace")
    out = (folder / ".stdout").read_text("utf-8", "replace")
    if os.WIFSIGNALED(status):
        number = signal.Signals(os.WTERMSIG(status))
        slow = f"more than {PROCESSOR} s of the processor" if number == signal.SIGXCPU else ""
        return [slow or f"killed by {number.name}"]
    code = os.WEXITSTATUS(status)
    wrong: list[str] = []
    if code not in attempt.allowed:
        wrong.append(f"exit {code}")
    if code not in (0, 130) and not said.strip():
        wrong.append("failed without a word")
    if found := FOREIGN.search(said):
        line = next(line for line in reversed(said.splitlines()) if line.strip())
        wrong.append(f"{found[0]!r} in: {line[:160]}")
    if "out of memory" in said and attempt.memory == MEMORY:
        wrong.append("asked for more memory than there is")
    if longest := max((len(line) for line in said.splitlines()), default=0) > LONGEST:
        wrong.append(f"a message of {longest} characters")
    if re.search(r"\b(NaN|Infinity)\b", out) and "--json" in attempt.arguments:
        wrong.append("a figure that is no number in JSON")
    return wrong


def _run(attempt: Attempt, folder: Path) -> NoReturn:
    """In the fork: limits, folder, streams; then the attempt, whose end is this process's."""
    code = 70
    try:
        from dualdrive_cli._stop import guard

        guard.stand()
        os.chdir(folder)
        if attempt.prepare:
            attempt.prepare()
        for number, name in ((1, ".stdout"), (2, ".stderr")):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        sys.stdin = open(os.devnull)  # noqa: SIM115, PTH123 -- for as long as the process lives
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", errors="strict", closefd=False)
        sys.stderr = os.fdopen(
            2, "w", encoding="utf-8", errors="backslashreplace", closefd=False, buffering=1
        )
        if not attempt.cold:
            Path(_BEGUN).touch()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (attempt.memory, attempt.memory))
        resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR, PROCESSOR + 1))
        if attempt.cold:
            command = [sys.executable, "-c", _COLD, *attempt.arguments]
            os.execv(sys.executable, command)
        code = _call(attempt.call) if attempt.call else _command(attempt.arguments)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _command(arguments: Sequence[str]) -> int:
    from dualdrive_cli.main import main

    sys.argv = ["dualdrive", *arguments]
    try:
        main(list(arguments), prog_name="dualdrive")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(bool(end.code))
    return 0


def _call(function: Callable[[], object]) -> int:
    """0 where it returns, 2 where it refuses in words of our own; anything else is raised."""
    try:
        function()
    except ValueError as error:
        if type(error) is ValueError or not type(error).__module__.startswith("dualdrive"):
            raise
        print(error, file=sys.stderr)
        return 2
    return 0


def _until_it_begins(folder: Path, child: int) -> None:
    end = time.monotonic() + ASLEEP
    while not (folder / _BEGUN).exists() and time.monotonic() < end:
        if os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            return  # it never began; what it said is judged
        time.sleep(0.001)


def _wait(child: int, interrupt: float | None, serving: Path | None) -> tuple[int, float]:
    """Status of the fork and the most memory it used, bytes; it is stopped where it falls asleep.

    serving: what a page that is served prints once it is there, which then gets Ctrl-C
    """
    if interrupt is not None:
        time.sleep(interrupt)
        os.kill(child, signal.SIGINT)
    end = time.monotonic() + ASLEEP
    while True:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            return status, used.ru_maxrss * 1024.0
        if serving and serving.exists() and serving.stat().st_size:
            os.kill(child, signal.SIGINT)
            serving = None
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            end = float("inf")
        time.sleep(0.002)


def _hash(path: Path) -> str:
    if not path.is_file():
        return "none"
    return hashlib.sha256(path.read_bytes()).hexdigest()
