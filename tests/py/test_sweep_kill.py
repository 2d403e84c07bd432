"""Sweeps that are killed, stopped, or run into a full disk: the file opens, and nothing is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import dualdrive
import sweep_worker
from dualdrive.ensembles import SPEED
from dualdrive.files import FileError
from dualdrive.machine import Machine
from dualdrive.sweeps import Sweep, lay_out, load_sweep
from dualdrive.sweeps.layout import lay_file
from full_disk import full_disk
from patience import PATIENCE

WORKER = str(Path(sweep_worker.__file__))
RUNS, BLANK = 40, 20_000


def start(
    verb: str, path: Path, limit: Callable[[], None] | None = None, dies_after: int = 0
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, WORKER, verb, str(path), str(dies_after)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=partial(prepare, limit),
    )


def prepare(limit: Callable[[], None] | None) -> None:
    """In the new process: hear Ctrl-C, which a shell's background job inherits as ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if limit is not None:
        limit()


def figures(sweep: Sweep) -> dict[str, bytes]:
    """Everything that is computed, as bytes; the measured speed is not."""
    names = [*(n for n in sweep.figures if n != "speed"), "status", "message", "e"]
    data = sweep.dataset
    return {n: np.asarray(data[n].values, dtype=data[n].encoding["dtype"]).tobytes() for n in names}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The figures of a sweep that nobody disturbed, on one thread."""
    with sweep_worker.run(tmp_path_factory.mktemp("whole") / "sweep.h5", jobs=1) as sweep:
        assert not sweep.failed
        assert sweep.pending == 0
        return figures(sweep)


def test_killed_again_and_again_a_sweep_is_completed_to_the_same_bytes(
    tmp_path: Path, whole: dict[str, bytes]
) -> None:
    path = tmp_path / "sweep.h5"
    done, before = 0, np.full((20, 2), np.nan)
    for wanted in (1, 9, 18, 27):
        worker = start("run", path, dies_after=wanted)
        out, _ = worker.communicate()
        begun = int(out.split()[0])
        assert begun >= done, "runs that were done are pending again"
        assert worker.returncode == -signal.SIGKILL
        with load_sweep(path) as sweep:
            done = RUNS - sweep.pending
            assert wanted <= done < RUNS, "killed too late to show anything"
            status = sweep.dataset["status"].values
            speed = sweep.dataset["speed"].values
            assert np.isfinite(sweep.dataset["peak_error"].values[status == "success"]).all()
            # how fast a run was differs each time: the same value says it was not done again
            known = np.isfinite(before)
            np.testing.assert_array_equal(speed[known], before[known])
            before = np.where(status == "success", speed, np.nan)
    with sweep_worker.run(path, jobs=2) as sweep:
        assert sweep.pending == 0
        known = np.isfinite(before)
        np.testing.assert_array_equal(sweep.dataset["speed"].values[known], before[known])
        assert figures(sweep) == whole


def test_a_sweep_can_be_read_but_not_filled_by_others_while_it_runs(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    worker = start("run", path)
    assert worker.stdout is not None
    for line in worker.stdout:
        if int(line.split()[0]) >= 3:
            break
    os.kill(worker.pid, signal.SIGSTOP)
    try:
        assert 3 <= RUNS - pending(path) < RUNS
        with pytest.raises(FileError, match="another sweep is filling it"):
            sweep_worker.run(path)
    finally:
        worker.kill()
        worker.wait()


def test_a_sweep_is_not_replaced_while_another_fills_it(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    worker = start("run", path)
    assert worker.stdout is not None
    worker.stdout.readline()
    os.kill(worker.pid, signal.SIGSTOP)
    before = path.stat().st_ino
    try:
        with pytest.raises(FileError, match="another sweep is filling it"):
            dualdrive.sweep("bench", {"table.J": "0.2,0.3"}, output=path, overwrite=True)
        assert path.stat().st_ino == before
    finally:
        worker.kill()
        worker.wait()


def test_of_two_that_begin_at_once_the_second_takes_nothing_from_the_first(tmp_path: Path) -> None:
    """Both saw that there was no file: the one that comes later must not put its own there."""
    path = tmp_path / "sweep.h5"
    grid = lay_out(Machine.load(), {"table.J": "1e6,2e6"})
    lay_file(path, grid, [SPEED], {})
    before = path.stat().st_ino
    with pytest.raises(FileError, match="another program made it; it stays"):
        lay_file(path, grid, [SPEED], {})
    assert path.stat().st_ino == before
    assert list(tmp_path.iterdir()) == [path]


def test_two_resumes_of_one_file(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    words = ("heavy-table-550t", "--delta", "0:2mrad:400", "--jobs", "1", "-o", str(path))
    first = cli(*words)
    while not path.exists():
        assert first.poll() is None, first.communicate()
        time.sleep(0.01)
    os.kill(first.pid, signal.SIGSTOP)
    try:
        _, told = cli("--resume", "-o", str(path)).communicate(timeout=PATIENCE)
        assert told == (
            f"dualdrive: {path}: another dualdrive (process {first.pid}) is about to write it; "
            "wait for it, or name another file\n"
        )
    finally:
        first.kill()
        first.wait()


def test_a_finished_sweep_is_not_touched(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "sweep.h5"
    sweep_worker.run(path)
    content = path.read_bytes()
    capsys.readouterr()
    sweep_worker.run(path)
    assert capsys.readouterr().out == f"{RUNS} {RUNS}\n"
    assert path.read_bytes() == content


@pytest.mark.parametrize("delay", [0.001, 0.05])
def test_killed_in_the_midst_of_writing(tmp_path: Path, delay: float) -> None:
    """Every run that counts as done has all its numbers, whenever the writer dies."""
    path = tmp_path / "sweep.h5"
    for _ in range(2):
        worker = start("write_only", path)
        assert worker.stdout is not None
        assert worker.stdout.readline() == "ready\n"
        time.sleep(delay)
        worker.kill()
        worker.wait()
        with xr.open_dataset(path) as data:
            flat = data.stack(run=("meshes.gap", "table.J"))
            done = np.flatnonzero(flat["status"].values == "success")
            assert len(done) < BLANK, "killed too late to show anything"
            np.testing.assert_array_equal(flat["speed"].values[done], done + 0.5)
            np.testing.assert_array_equal(flat["e"].values[:, done], np.tile(done, (20, 1)))
            assert list(flat["message"].values[done]) == [f"run {k}" for k in done]


def test_killed_before_the_file_is_laid_out_nothing_bears_its_name(tmp_path: Path) -> None:
    """A hang in the midst of creation, then a kill: no half-made sweep.h5."""
    path = tmp_path / "sweep.h5"
    code = (
        "import sys, time, sweep_worker\n"
        "from dualdrive.sweeps import layout\n"
        "def hang(*_): print('laid', flush=True); time.sleep(60)\n"
        "layout._dataset = hang\n"
        f"sweep_worker.blank(sweep_worker.Path({str(path)!r}))\n"
    )
    here = {**os.environ, "PYTHONPATH": str(Path(WORKER).parent)}
    worker = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=here)
    assert worker.stdout is not None
    assert worker.stdout.readline() == b"laid\n"
    worker.kill()
    worker.wait()
    assert not path.exists()
    sweep_worker.blank(path)
    assert load_sweep(path).pending == BLANK


def cli(*words: str, limit: Callable[[], None] | None = None) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "dualdrive_cli", "sweep", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=partial(prepare, limit),
    )


def pending(path: Path) -> int:
    with load_sweep(path) as sweep:
        return sweep.pending


def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    words = ("heavy-table-550t", "--delta", "0:2mrad:400", "--jobs", "1", "-o", str(path))
    worker = cli(*words)
    while not path.exists():
        assert worker.poll() is None, worker.communicate()
        time.sleep(0.01)
    time.sleep(0.3)
    worker.send_signal(signal.SIGINT)
    out, err = worker.communicate(timeout=PATIENCE)
    assert worker.returncode == 130
    assert out == ""
    left = pending(path)
    assert 0 < left < 400
    assert f"stopped with {400 - left} of 400 runs done" in err
    assert f"dualdrive sweep --resume -o {path}" in err
    assert err.splitlines()[0] == "finishing the runs under way; Ctrl-C again ends at once"
    assert err.count("\n") == 2


def test_a_second_ctrl_c_ends_at_once(tmp_path: Path) -> None:
    """Runs of hours are not waited for; the file still opens."""
    path = tmp_path / "sweep.h5"
    endless = ("--motion", "sine:1mrad,f=5,end=100000", "--output-step", "1")
    worker = cli("--delta", "0:1e-3:4", *endless, "-o", str(path))
    while not path.exists():
        assert worker.poll() is None, worker.communicate()
        time.sleep(0.01)
    time.sleep(0.3)
    worker.send_signal(signal.SIGINT)
    assert worker.stderr is not None
    assert "Ctrl-C again ends at once" in worker.stderr.readline()
    assert worker.poll() is None
    worker.send_signal(signal.SIGINT)
    assert worker.wait(timeout=PATIENCE) == 130
    assert worker.stderr.readline() == "dualdrive: stopped\n"
    assert pending(path) == 4


def test_a_disk_without_room_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    worker = cli("--delta", "0:1e-3:100", "--keep", "e", "-o", str(path), limit=full_disk(200_000))
    out, err = worker.communicate(timeout=PATIENCE)
    assert (worker.returncode, out) == (1, "")
    assert err.startswith(f"dualdrive: {path}: cannot be written: ")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fails_under_way_loses_nothing(tmp_path: Path, whole: dict[str, bytes]) -> None:
    """All space is taken at the start; a later fault is met by letting no write through."""
    path = tmp_path / "sweep.h5"
    worker = start("run", path)
    assert worker.stdout is not None
    for line in worker.stdout:
        if int(line.split()[0]) >= 5:
            break
    worker.kill()
    worker.wait()
    left = pending(path)
    second = start("run", path, limit=full_disk(4096))
    _, err = second.communicate(timeout=PATIENCE)
    assert second.returncode == 1
    last = err.strip().splitlines()[-1]
    assert "WriteError" in last
    assert f"{path}: cannot be written: File too large" in last
    assert pending(path) == left
    with sweep_worker.run(path) as sweep:
        assert figures(sweep) == whole
