"""`dualdrive sweep` as people type it: results, files, and one clear line when it cannot be."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner, Result

from dualdrive.sweeps import load_sweep
from dualdrive_cli.main import main

SHORT = ("--motion", "move:0.01,v=0.03,a=0.01,j=0.05,start=1,end=4.5")
COMMAND = [sys.executable, "-m", "dualdrive_cli", "sweep"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Every test types in an empty folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def typed(*words: str) -> Result:
    return CliRunner().invoke(main, ["sweep", *words])


def refused(result: Result, code: int, *says: str) -> None:
    assert result.exit_code == code, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("dualdrive: ")
    assert result.stderr.count("\n") == 1, "more than one line"
    for text in says:
        assert text in result.stderr


def test_as_the_issue_types_it(folder: Path) -> None:
    done = subprocess.run(
        [*COMMAND, "--delta", "0:1e-3:20"], capture_output=True, text=True, check=True
    )
    assert done.stderr == "", "no bar where nobody looks"
    assert re.search(r"^meshes\.gap +0 mrad to 1 mrad, 20 values", done.stdout, re.M)
    assert re.search(r"^written +sweep\.h5", done.stdout, re.M)
    assert re.search(r"^do not change over the grid: .*peak_error 6\.\d+ arcsec", done.stdout, re.M)
    with xr.open_dataset("sweep.h5") as data:
        np.testing.assert_allclose(data["meshes.gap"], np.linspace(0, 1e-3, 20), atol=1e-18)
        assert (data["status"] == "success").all()
        assert data.attrs["command"].endswith("sweep --delta 0:1e-3:20")
    before = Path("sweep.h5").read_bytes()
    says = ("sweep.h5: exists already", "--resume", "--overwrite", "-o")
    refused(typed("--delta", "0:1e-3:20"), 1, *says)
    assert Path("sweep.h5").read_bytes() == before
    assert [path.name for path in folder.iterdir()] == ["sweep.h5"]


def test_several_axes_units_changes_and_files(folder: Path) -> None:
    result = typed(
        *("heavy-table-250t", "--delta", "0,1.1mrad,2.2mrad", "--controller.T_ten=0:60%:2"),
        *("--set", "table.J=9.6e6", "--keep", "e,T_1", "--jobs", "2", "--load", "5kN*m"),
        *("-o", "grid.h5", "--json", "grid.json", "--plot", "grid.png", *SHORT),
    )
    assert result.exit_code == 0, result.output
    assert Path("grid.png").read_bytes().startswith(b"\x89PNG")
    with load_sweep(Path("grid.h5")) as swept:
        assert list(swept.axes) == ["meshes.gap", "controller.T_ten"]
        np.testing.assert_allclose(swept.axes["controller.T_ten"], [0, 60])
        assert swept.dataset["T_1"].shape == (3, 2, 4501)
        assert swept.machine.get("table.J") == 9.6e6
        assert swept.attributes["load"] == 5e3
        report = json.loads(Path("grid.json").read_text())
        assert report["axes"]["meshes.gap"] == {"unit": "rad", "values": [0, 1.1e-3, 2.2e-3]}
        assert [run["status"] for run in report["runs"]] == ["success"] * 6
        peaks = swept.dataset["peak_error"].values.ravel().tolist()
        assert [run["peak_error"] for run in report["runs"]] == peaks
        assert report["figures"]["peak_error"]["unit"] == "rad"


def test_json_alone_on_the_output() -> None:
    result = typed("--delta", "0,1e-3", "--json", "-", *SHORT)
    assert result.exit_code == 0
    assert len(json.loads(result.stdout)["runs"]) == 2


def test_keep_alone_keeps_every_signal() -> None:
    assert typed("--delta", "0,1e-3", *SHORT, "--keep").exit_code == 0
    with xr.open_dataset("sweep.h5") as data:
        assert {"theta_ref", "theta_m", "T_2", "mesh_1.twist", "I_1"} <= set(data.data_vars)
        # the table follows: at the end it stands where it was told to
        np.testing.assert_allclose(data["theta_m"].isel(t=-1), 0.01, atol=1e-5)


def test_resume_completes_alone_or_as_typed_before() -> None:
    words = ("--delta", "0,1e-3", *SHORT)
    assert typed(*words).exit_code == 0
    before = Path("sweep.h5").read_bytes()
    assert typed("--resume").exit_code == 0
    assert typed(*words, "--resume").exit_code == 0
    assert Path("sweep.h5").read_bytes() == before
    other = typed("--delta", "0,2e-3", *SHORT, "--resume")
    refused(other, 2, "sweep.h5: is a sweep of something else: meshes.gap: ", "2 mrad here")
    refused(typed("bench", "--resume"), 2, "machine: the file says it already")
    refused(typed("--end", "3", "--resume"), 2, "--end: the file says it already")
    assert Path("sweep.h5").read_bytes() == before


def test_some_failed_runs_are_told_and_no_error() -> None:
    result = typed("--table.J", "0,4.95e6", *SHORT)
    assert result.exit_code == 0
    assert (
        "1 of 2 runs failed; first at table.J = 0 kg·m²: refused: heavy-table-100t: body table"
        in result.stderr
    )
    with load_sweep(Path("sweep.h5")) as swept:
        assert swept.dataset["status"].values.tolist() == ["refused", "success"]


def test_when_no_run_succeeds_the_computation_failed() -> None:
    result = typed("--delta", "0,1e-3", "--max-steps", "10", *SHORT)
    assert result.exit_code == 1
    assert "2 of 2 runs failed; first at meshes.gap = 0 mrad: too_many_steps" in result.stderr


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "no axis to sweep; give one, e.g. --delta 0:1e-3:20"),
        (["--delta"], "--delta: needs values"),
        (["--delta", "--jobs", "2"], "--delta: needs values"),
        (["--delta", "-o", "x.h5"], "--delta: needs values"),
        (["--delta", "0:1e-3:0"], "count of at least 1"),
        (["--delta", "1e-3:0"], "a range is start:stop:count"),
        (["--delta", "0:nan:3"], "not a number"),
        (["--delta", "inf,0"], "not a number"),
        (["--delta", "0,1e-3,0"], "0 rad occurs more than once"),
        (["--delta", "-1e-3:1e-3:3"], "must be at least 0"),
        (["--delta", "0,1s"], "s does not measure rad"),
        (["--delta", "0,1e-3", "--delta", "2e-3"], "--delta: given twice"),
        (["--delta", "0,1e-3", "--mesh_2.gap", "0,1"], "mesh_2.gap, as delta does"),
        (["--delta", "0,1e-3", "--set", "mesh_1.gap=1e-3"], "the axis meshes.gap sets it too"),
        (["--delta", "0,1e-3", "--set", "table.J=1s"], "s does not measure"),
        (["--meshes.gp", "0,1"], "did you mean"),
        (["--job", "2", "--delta", "0,1"], "--job: no such option, nor a parameter; did you mean"),
        (["--delta", "0,1e-3", "--jobs", "0"], "jobs = 0: must be at least 1"),
        (["--delta", "0,1e-3", "hevy-table-100t"], "did you mean heavy-table-100t"),
        (["--delta", "0,1e-3", "--motion", "moev:1"], "'moev' is unknown"),
        (["--delta", "0,1e-3", "--keep", "theta_n"], "no such signal"),
        (["--delta", "0,1e-3", "--load", "5kg"], "kg does not measure"),
        (["--delta", "0:1e-3:10000", "--table.J", "1:2:1000", "--keep"], "TB, the disk has"),
        (["--delta", "0:1e-3:100000", "--table.J", "1:2:1000"], "100,000,000 runs"),
        (["--resume"], "sweep.h5: there is no such file"),
    ],
)
def test_what_cannot_be_asked(folder: Path, words: list[str], says: str) -> None:
    refused(typed(*words), 2, says)
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("output", "says"),
    [
        ("no/such/folder/sweep.h5", "there is no folder"),
        ("/dev/full", "not a regular file"),
        ("/proc/sweep.h5", ""),
    ],
)
def test_where_nothing_can_be_written(output: str, says: str) -> None:
    words = ("--delta", "0,1e-3", "-o", output, "--overwrite", *SHORT)
    refused(typed(*words), 1, f"{output}: cannot be written", says)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(folder: Path) -> None:
    folder.chmod(0o500)
    try:
        refused(typed("--delta", "0,1e-3", *SHORT), 1, "Permission denied")
    finally:
        folder.chmod(0o700)


def test_a_file_that_is_no_sweep_is_left_alone() -> None:
    Path("sweep.h5").write_text("my notes")
    refused(typed("--delta", "0,1e-3", "--resume"), 2, "sweep.h5: is not a sweep")
    refused(typed("--resume"), 2, "sweep.h5: is not a sweep")
    refused(typed("--delta", "0,1e-3"), 1, "sweep.h5: exists already")
    assert Path("sweep.h5").read_text() == "my notes"


def test_help_shows_an_example() -> None:
    result = typed("--help")
    assert result.exit_code == 0
    assert "dualdrive sweep --delta 0:1e-3:20" in result.output
    assert "--resume" in result.output


def test_a_bar_on_a_terminal() -> None:
    """Standard error is a terminal here, standard output a file: the bar is on the former only."""
    try:
        leader, follower = pty.openpty()
    except OSError as error:
        pytest.skip(f"no terminal to be had: {error}")
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    with Path("out").open("wb") as out:
        words = ["--delta", "0:1e-3:20", *SHORT]
        worker = subprocess.Popen([*COMMAND, *words], stdout=out, stderr=follower, env=environment)
    os.close(follower)
    shown = b""
    try:
        while part := os.read(leader, 65536):
            shown += part
    except OSError:  # the terminal is gone with its process
        pass
    os.close(leader)
    assert worker.wait() == 0
    assert b"20/20" in shown
    assert b"0:00:0" in shown, "no time left is shown"
    assert b"20/20" not in Path("out").read_bytes()
