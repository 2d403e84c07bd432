"""Schedulers and workers that can't do the work: one line, before any file is made."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from clusters import Cluster
from dualdrive import distributed
from dualdrive.build import fingerprint
from dualdrive.distributed import SchedulerError, connected
from dualdrive.identify import fit
from dualdrive.sweeps import GridError, sweep
from dualdrive_cli.main import main
from recorded import DEMO, demo, sheet

pytest.importorskip("distributed", reason="needs Dask: pip install 'dualdrive[distributed]'")

AXES: dict[str, Any] = {"delta": [0.0, 1e-3]}

OTHER_CORE = """
import dualdrive.build as build
other = {**build.fingerprint(), "core": "0123 baseline"}
build.fingerprint = lambda: other
"""
NOTHING = """
import sys
class Nothing:
    def find_spec(name, *_):
        if name == "dualdrive":
            raise ModuleNotFoundError("there is none", name=name)
sys.meta_path.insert(0, Nothing)
"""
BROKEN = "import sys; sys.modules['dualdrive.build'] = None"


@pytest.mark.parametrize(
    ("preload", "words"),
    [
        pytest.param(OTHER_CORE, "core 0123 baseline there, .* here; install", id="other build"),
        pytest.param(NOTHING, "dualdrive is not installed there", id="no dualdrive"),
        pytest.param(BROKEN, "dualdrive without dualdrive.build there", id="an older dualdrive"),
    ],
)
def test_workers_that_would_compute_other_bits(
    mortal: Cluster, tmp_path: Path, preload: str, words: str
) -> None:
    mortal.grow(1, preload)
    with pytest.raises(SchedulerError, match=f"worker tcp://127.0.0.1:.*{words}") as refused:
        sweep("heavy-table-250t", AXES, output=tmp_path / "s.h5", scheduler=mortal.address)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "s.h5").exists()


def test_a_worker_of_another_build_that_joins_later_computes_nothing() -> None:
    with pytest.raises(SchedulerError, match=r"that joined differs: core .* there, 0 here"):
        distributed._run({**fingerprint(), "core": "0"}, print, "never")


@pytest.mark.long
@pytest.mark.usefixtures("hasty")
def test_a_scheduler_without_workers(mortal: Cluster, tmp_path: Path) -> None:
    with pytest.raises(SchedulerError, match="no workers; begin some with 'dask worker tcp://127"):
        sweep("heavy-table-250t", AXES, output=tmp_path / "s.h5", scheduler=mortal.address)
    assert not (tmp_path / "s.h5").exists()


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "carrier://pigeon:1", ""])
@pytest.mark.parametrize("verb", ["sweep", "fit"])
def test_a_wrong_address_is_one_line(address: str, verb: str, tmp_path: Path) -> None:
    words = {
        "sweep": ["sweep", "--delta", "0,1e-3", "-o", str(tmp_path / "s.h5")],
        "fit": ["fit", *(str(p) for p in demo_files()), "--free", "table.J"],
    }
    result = CliRunner().invoke(main, [*words[verb], "--scheduler", address])
    assert result.exit_code == 1
    assert result.stderr.startswith(f"dualdrive: scheduler = {address!r}: ")
    assert "leave it out to compute here" in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "s.h5").exists()


def demo_files() -> tuple[Path, Path]:
    return DEMO / "machine.toml", DEMO / "fit.csv"


def test_threads_and_a_scheduler_are_not_asked_for_together() -> None:
    with pytest.raises(GridError, match="leave jobs or scheduler out"):
        sweep("heavy-table-250t", AXES, jobs=2, scheduler="tcp://127.0.0.1:9")


def test_a_torque_balance_has_nothing_to_spread() -> None:
    with pytest.raises(ValueError, match="nothing to spread"):
        fit(sheet(), demo("fit"), mode="balance", scheduler="tcp://127.0.0.1:9")


def test_without_dask_the_way_out_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(SchedulerError, match=r"pip install 'dualdrive\[distributed\]'"),
        connected("tcp://127.0.0.1:9"),
    ):
        pass
