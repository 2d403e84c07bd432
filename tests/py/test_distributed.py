"""Sweeps and fits on a real scheduler with workers of their own: same bits, whatever is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from clusters import Cluster
from dualdrive import Machine
from dualdrive.distributed import SchedulerError, connected
from dualdrive.identify import Fit, Progress, fit
from dualdrive.mapper import mapped
from dualdrive.motion import sampled
from dualdrive.sweeps import Outcome, load_sweep, resume, sweep
from recorded import demo, sheet

pytest.importorskip("distributed", reason="needs Dask: pip install 'dualdrive[distributed]'")

AXES: dict[str, Any] = {"delta": "0:2mrad:9", "controller.T_ten": "0:60:7"}
RUNS = 63
MOTION = "move:0.01,v=0.03,a=0.01,j=0.05,start=1,end=5"
FREE = ["table.J", "coulomb@table.torque"]
#: a fit that has not converged yet has the same bits too
SHORT: dict[str, Any] = {"rtol": 1e-5, "max_simulations": 6}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A scheduler and two workers that no test harms."""
    with Cluster(tmp_path_factory.mktemp("cluster")) as cluster:
        yield cluster.grow(2)


def machine() -> Machine:
    return Machine.load("heavy-table-250t")


def swept(path: Path, **options: Any) -> dict[str, Any]:
    """All that the file of a sweep holds when it is done, but for the measured speed."""
    sweep(machine(), AXES, motion=MOTION, output=path, keep=["e"], command="c", **options).close()
    return content(path)


def content(path: Path) -> dict[str, Any]:
    with h5py.File(path) as file:
        found: dict[str, Any] = {n: d[...].tobytes() for n, d in file.items() if n != "speed"}
        return found | {n: str(value) for n, value in file.attrs.items()}


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return swept(tmp_path_factory.mktemp("local") / "sweep.h5")


class Watch:
    """Notes the runs that come in and, once after some, does a deed."""

    def __init__(self, deed: Callable[[], object] = lambda: None, after: int = 5) -> None:
        self.runs, self.deed, self.after = list[int](), deed, after

    def __call__(self, done: int, total: int, outcomes: list[Outcome]) -> None:
        self.runs += [outcome.run for outcome in outcomes]
        if self.after and len(self.runs) >= self.after:
            assert len(self.runs) < total
            self.after = 0
            self.deed()


# --- sweeps ---------------------------------------------------------------------------------------


def test_a_sweep_has_the_same_bits_as_a_local_one(
    cluster: Cluster, local: dict[str, Any], tmp_path: Path
) -> None:
    watch = Watch()
    assert swept(tmp_path / "s.h5", scheduler=cluster.address, progress=watch) == local
    assert sorted(watch.runs) == list(range(RUNS))


def test_a_worker_killed_in_mid_sweep_costs_nothing(
    mortal: Cluster, local: dict[str, Any], tmp_path: Path
) -> None:
    mortal.grow(2)
    watch = Watch(mortal.workers[0].kill)
    assert swept(tmp_path / "s.h5", scheduler=mortal.address, progress=watch) == local
    assert mortal.workers[0].wait() == -signal.SIGKILL
    assert sorted(watch.runs) == list(range(RUNS)), "nothing lost, nothing twice"


@pytest.mark.long
@pytest.mark.parametrize(
    ("victims", "words"),
    [
        pytest.param(lambda c: [c.scheduler], "the scheduler was lost", id="scheduler"),
        pytest.param(lambda c: c.workers, "no worker is left, for 1 s", id="all workers"),
    ],
)
@pytest.mark.usefixtures("hasty")
def test_what_was_finished_is_kept_and_completed(
    mortal: Cluster, local: dict[str, Any], tmp_path: Path, victims: Any, words: str
) -> None:
    mortal.grow(1)
    path = tmp_path / "s.h5"
    watch = Watch(lambda: [process.kill() for process in victims(mortal)])
    with pytest.raises(SchedulerError, match=f"{words}.*{path}: what was .* --resume") as lost:
        swept(path, scheduler=mortal.address, progress=watch)
    assert "\n" not in str(lost.value)
    with load_sweep(path) as partial:
        assert 0 < partial.pending <= RUNS - len(watch.runs)
    resume(path).close()
    assert content(path) == local


def test_ctrl_c_keeps_what_is_under_way(
    cluster: Cluster, local: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / "s.h5"
    watch = Watch(lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        swept(path, scheduler=cluster.address, progress=watch)
    with load_sweep(path) as partial:
        assert partial.pending == RUNS - len(watch.runs)
    resume(path, scheduler=cluster.address).close()
    assert content(path) == local


def test_ctrl_c_asks_again_for_a_task_that_the_scheduler_does_not_know_yet(
    cluster: Cluster, local: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Submitting is batched: a run may be asked for before it has come there."""
    from distributed import Client

    asked, answer = [], Client.call_stack

    def early(self: Client, *args: Any, **options: Any) -> Any:
        asked.append(options)
        if len(asked) == 1:
            raise KeyError("_run-0")
        return answer(self, *args, **options)

    monkeypatch.setattr(Client, "call_stack", early)
    test_ctrl_c_keeps_what_is_under_way(cluster, local, tmp_path)
    assert len(asked) > 1


def test_a_sampled_motion_travels_and_failures_are_outcomes(
    cluster: Cluster, tmp_path: Path
) -> None:
    t = np.linspace(0.0, 4.0, 4001)
    motion, found = sampled(t, 1e-3 * np.sin(t) ** 2), []
    for name, where in (("a", None), ("b", cluster.address)):
        path = tmp_path / f"{name}.h5"
        axes = {"table.J": [0.0, 4e6], "delta": [0.0, 1e-3]}
        sweep(machine(), axes, motion=motion, output=path, scheduler=where, command="c").close()
        found.append(content(path))
    assert found[0] == found[1]
    assert b"refused" in found[0]["status"]


# --- fits -----------------------------------------------------------------------------------------


def same(a: Fit, b: Fit) -> bool:
    return (
        a.figures() == b.figures()
        and a.covariance.tobytes() == b.covariance.tobytes()
        and a.failures == b.failures
        and a.simulations == b.simulations
        and a.machine.toml() == b.machine.toml()
    )


def of_three_starts(**options: Any) -> Fit:
    found: Fit = fit(sheet(torque=1000.0), demo("fit"), FREE, starts=3, **SHORT, **options)
    return found


@pytest.fixture(scope="module")
def local_fit() -> Fit:
    return of_three_starts()


@pytest.mark.long
def test_a_fit_of_several_starts_is_the_local_one(cluster: Cluster, local_fit: Fit) -> None:
    told: list[Progress] = []
    there = of_three_starts(scheduler=cluster.address, progress=told.append)
    assert same(there, local_fit)
    assert sorted(now.start for now in told) == [1, 2, 3]


@pytest.mark.long
def test_a_worker_killed_in_mid_fit_costs_nothing(mortal: Cluster, local_fit: Fit) -> None:
    """Told of its first start, the fit has two more under way or to do, one worker for them."""
    mortal.grow(2)
    told: list[Progress] = []

    def kill_one(now: Progress) -> None:
        told.append(now)
        mortal.workers[0].kill()

    there = of_three_starts(scheduler=mortal.address, progress=kill_one)
    assert mortal.workers[0].wait() == -signal.SIGKILL
    assert same(there, local_fit)
    assert sorted(now.start for now in told) == [1, 2, 3], "no start lost, none told twice"


@pytest.mark.long
def test_a_fit_of_several_records_is_the_local_one(cluster: Cluster) -> None:
    from distributed import Client

    records = {"one": demo("fit"), "other": demo("held_out")}
    here = fit(sheet(torque=1000.0), records, FREE, **SHORT)
    with Client(cluster.address, set_as_default=False) as client:
        there = fit(sheet(torque=1000.0), records, FREE, scheduler=client, **SHORT)
        assert client.status == "running", "a client that was lent stays open"
    assert same(here, there)


@pytest.mark.long
def test_a_fit_keeps_the_starts_that_ended_before_the_scheduler_was_lost(mortal: Cluster) -> None:
    mortal.grow(1)
    found = of_three_starts(scheduler=mortal.address, progress=lambda _: mortal.scheduler.kill())
    assert found.status == "not_converged"
    assert "the scheduler was lost" in found.message
    assert "1 of 3 starts" in found.message
    assert np.isfinite(found.error["refitted"])


# --- the pieces -----------------------------------------------------------------------------------


def test_an_error_of_a_job_is_raised_and_order_is_kept(cluster: Cluster) -> None:
    with connected(cluster.address) as workers:
        assert mapped(workers, divmod, [(k, 7) for k in range(40)]) == [
            divmod(k, 7) for k in range(40)
        ]
        with pytest.raises(ZeroDivisionError):
            mapped(workers, divmod, [(1, 1), (1, 0)])


@pytest.mark.long
def test_the_command_line(cluster: Cluster, tmp_path: Path) -> None:
    words = ["sweep", "heavy-table-250t", "--delta", "0:2mrad:6", "--motion", MOTION]
    program = [sys.executable, "-c", "from dualdrive_cli.main import main; main()", *words]
    found = []
    for name, more in (("a", []), ("b", ["--scheduler", cluster.address])):
        path = tmp_path / f"{name}.h5"
        done = subprocess.run([*program, "-o", str(path), *more], capture_output=True, check=False)
        assert done.returncode == 0, done.stderr
        found.append({k: v for k, v in content(path).items() if k != "command"})
    assert found[0] == found[1]
