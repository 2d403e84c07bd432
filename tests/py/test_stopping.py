"""Ctrl-C and SIGTERM at any moment: one line, exit code 130 or 143, nothing half written."""

from __future__ import annotations

import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner

import dualdrive
from dualdrive.identify.closed_loop import Problem
from dualdrive.interrupt import interrupt
from dualdrive_cli.main import main
from patience import PATIENCE
from recorded import Array
from test_cli_verbs import DUALDRIVE, hear_ctrl_c

DEMO = Path(dualdrive.__file__).parent / "demo"
MOMENTS = int(os.environ.get("MOMENTS", "8"))

#: The interpreter's own start, some 15 ms before any line of the project, is not the project's.
FROM_THE_FIRST_LINE = """
from dualdrive_cli.__main__ import main
print("here", flush=True)
main()
"""

LINES = (
    ("--help",),
    ("effects", "--json", "effects.json"),
    ("simulate", "bench", "-o", "run.h5", "--plot", "run.png", "--json", "run.json"),
    ("compare", "machine.toml", "fit.csv", "--plot", "compare.png"),
    ("sweep", "bench", "--delta", "0:1mrad:400", "-o", "sweep.h5"),
)
ENDLESS = ("simulate", "--motion", "sine:1mrad,f=1,end=1e6", "--output-step", "10s", "-o", "run.h5")


def begun(command: Sequence[str], folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=hear_ctrl_c,
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a machine and its record."""
    for name in ("machine.toml", "fit.csv"):
        shutil.copy(DEMO / name, tmp_path)
    return tmp_path


@pytest.mark.parametrize("seed", range(MOMENTS))
def test_ctrl_c_at_a_random_moment(seed: int, folder: Path) -> None:
    """Soon after the first line more often than late: that is where modules load."""
    choice = random.Random(seed)
    line, moment = choice.choice(LINES), 3.0 * choice.random() ** 2
    process = begun([sys.executable, "-c", FROM_THE_FIRST_LINE, *line], folder)
    assert process.stdout is not None
    assert process.stdout.readline() == "here\n"
    time.sleep(moment)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=PATIENCE)
    if process.returncode == 0:  # it was through before
        assert told == ""
    else:
        assert process.returncode == 130, told
        assert told.splitlines()[-1].startswith("dualdrive: ")
        assert "stopped" in told.splitlines()[-1]
    for word in ("Traceback", "Aborted", "Error", "ignored"):
        assert word not in told
    assert not list(folder.glob(".*")), "something half written was left"


#: Nothing but a file that is written over and over.
WRITING = """
from pathlib import Path
from dualdrive.files import write_atomically
print("here", flush=True)
while True:
    with write_atomically(Path("x.json"), flush=False) as file:
        file.write_text("1")
"""


@pytest.mark.long
def test_ctrl_c_in_the_midst_of_writing(tmp_path: Path) -> None:
    """A temporary file that was there before anybody owned it stayed in 9 of 120 runs."""
    choice = random.Random(0)
    for k in range(50):
        folder = tmp_path / str(k)
        folder.mkdir()
        process = begun([sys.executable, "-c", WRITING], folder)
        assert process.stdout is not None
        assert process.stdout.readline() == "here\n"
        time.sleep(0.002 + 0.01 * choice.random())
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=PATIENCE)
        assert "KeyboardInterrupt" in told
        assert not list(folder.glob(".*")), "something half written was left"


@pytest.mark.parametrize("verb", ["compare", "fit"])
@pytest.mark.parametrize("moment", [1, 2])
def test_ctrl_c_in_a_simulation_of_a_search(
    verb: str, moment: int, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first simulation, before which nothing is known, ended in exit code 1; another in 0."""
    calls, usual = itertools.count(1), Problem.residual

    def pressed(problem: Problem, u: Array) -> Array:
        if next(calls) == moment:
            signal.raise_signal(signal.SIGINT)
        return usual(problem, u)

    monkeypatch.setattr(Problem, "residual", pressed)
    monkeypatch.chdir(folder)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        done = CliRunner().invoke(main, [verb, "machine.toml", "fit.csv", "--json", "found.json"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert done.exit_code == 130, done.output
    assert "stopped" in done.stderr.splitlines()[-1]
    assert (folder / "found.json").exists() == (verb == "fit" and moment > 1)


@pytest.fixture
def heard() -> Iterator[None]:
    """A Ctrl-C is heard as in a terminal; what a shell starts behind itself does not hear any."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
def test_what_begins_after_a_ctrl_c_is_stopped_from_the_first() -> None:
    """Pressed while records were checked, it was forgotten by the search: 30 s instead of 2."""
    with interrupt() as outer:
        signal.raise_signal(signal.SIGINT)
        assert outer.is_set()
        with interrupt() as inner:
            assert inner.is_set()
            with pytest.raises(KeyboardInterrupt):  # the second one ends at once, here as well
                signal.raise_signal(signal.SIGINT)
    with interrupt() as anew:
        assert not anew.is_set()


def test_sigterm_says_that_nothing_was_kept(folder: Path) -> None:
    process = begun([*DUALDRIVE, *ENDLESS], folder)
    while not list(folder.glob(".run.h5.lock")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    process.terminate()
    out, told = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out) == (143, "")
    assert told.splitlines()[-1] == "dualdrive: stopped; nothing was written"
    assert not list(folder.glob("*.h5")) + list(folder.glob(".*"))


def test_sigterm_says_how_a_sweep_goes_on(folder: Path) -> None:
    """As a cluster ends a job whose time is up."""
    line = ("sweep", "heavy-table-550t", "--delta", "0:2mrad:400", "--jobs", "1", "-o", "sweep.h5")
    process = begun([*DUALDRIVE, *line], folder)
    while not (folder / "sweep.h5").exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    process.terminate()
    _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 143
    assert "of 400 runs done; 'dualdrive sweep --resume -o sweep.h5' completes it" in told


def test_what_was_written_before_is_named(folder: Path) -> None:
    """Stopped while the picture is drawn, the run is there already."""
    line = ("simulate", "bench", "-o", "run.h5", "--plot", "run.png")
    slow = FROM_THE_FIRST_LINE.replace("main()", "").join(
        (
            "import time, dualdrive.plots\n",
            "dualdrive.plots.overview = lambda _: time.sleep(60)\nmain()",
        )
    )
    process = begun([sys.executable, "-c", slow, *line], folder)
    while not (folder / "run.h5").exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert told.splitlines()[-1] == "dualdrive: stopped; written before: run.h5"


def test_an_ignored_ctrl_c_stays_ignored(folder: Path) -> None:
    """As a shell starts what it puts into the background."""
    ignoring = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n{FROM_THE_FIRST_LINE}"
    process = begun([sys.executable, "-c", ignoring, "effects"], folder)
    assert process.stdout is not None
    assert process.stdout.readline() == "here\n"
    process.send_signal(signal.SIGINT)
    out, told = process.communicate(timeout=PATIENCE)
    assert (process.returncode, told) == (0, "")
    assert "coulomb" in out


def test_what_was_half_made_when_ctrl_c_came_is_not_mourned(folder: Path) -> None:
    """A file whose constructor was cut has nothing to close, and its library says so aloud."""
    code = """
import signal
from dualdrive_cli._stop import guard

class HalfMade:
    def __init__(self):
        signal.raise_signal(signal.SIGINT)
        self.closed = False
    def __del__(self):
        self.closed

guard.stand()
guard.running = True
try:
    HalfMade()
except KeyboardInterrupt:
    print("heard")
"""
    process = begun([sys.executable, "-c", code], folder)
    assert process.communicate(timeout=PATIENCE) == ("heard\n", "")


def test_ctrl_c_in_a_destructor_is_not_lost(folder: Path) -> None:
    """Nothing can be raised from there; the interpreter would print a traceback and go on."""
    code = """
import signal, time
from dualdrive_cli._stop import guard

class Dying:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)

guard.stand()
guard.running = True
try:
    Dying()
    time.sleep(60)
except KeyboardInterrupt:
    print("heard")
"""
    process = begun([sys.executable, "-c", code], folder)
    assert process.communicate(timeout=PATIENCE) == ("heard\n", "")


def test_what_a_thread_holds_at_the_end_is_no_leak(folder: Path) -> None:
    """Every run of the tests ended with words of a library: "leaked 5 instances"."""
    code = """
import threading, time
from dualdrive import _core

threading.Thread(target=lambda _: time.sleep(600), args=(_core.Machine(),), daemon=True).start()
"""
    process = begun([sys.executable, "-c", code], folder)
    assert process.communicate(timeout=PATIENCE) == ("", "")
