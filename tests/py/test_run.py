"""Finished runs: what they hold, and that they survive a file, a pickle and a full disk."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr

import dualdrive
from dualdrive import FileError, Machine, Run, load_run, parse_motion, simulate
from dualdrive.motion import sampled
from full_disk import full_disk

MOVE = parse_motion("move:0.02,v=0.03,a=0.01,j=0.05,start=0.5,end=3")


@pytest.fixture(scope="module")
def run() -> Run:
    return simulate(Machine.load(), MOVE, sensitivities=["table.J", "meshes.gap"])


def same(a: Run, b: Run) -> None:
    assert np.array_equal(a.t, b.t)
    assert np.array_equal(a.values, b.values)
    assert np.array_equal(a.modes, b.modes)
    assert np.array_equal(a.sensitivities, b.sensitivities)
    assert np.array_equal(a.work, b.work)
    for name in ("names", "units", "long_names", "elements", "events", "parameters", "work_names"):
        assert getattr(a, name) == getattr(b, name), name
    for name in ("final_state", "status", "message", "statistics", "motion"):
        assert getattr(a, name) == getattr(b, name), name
    assert a.machine.toml() == b.machine.toml()


# --- what a run holds -----------------------------------------------------------------------------


def test_signals_are_views_that_cannot_be_written(run: Run) -> None:
    assert run.ok
    assert run.t[[0, -1]] == pytest.approx([0, 3])
    assert run["theta_m"].shape == run.t.shape
    assert np.shares_memory(run["theta_m"], run.values)
    with pytest.raises(ValueError, match="read-only"):
        run["theta_m"][0] = 1.0
    assert run["e"] == pytest.approx(run["theta_ref"] - run["theta_m"], abs=1e-15)
    assert run.units["T_1"] == "N*m"


def test_a_signal_that_is_not_there_is_named(run: Run) -> None:
    with pytest.raises(KeyError, match=r"did you mean.*theta_m"):
        run["theta_mm"]
    with pytest.raises(KeyError, match=r"asked for were table\.J"):
        run.sensitivity("e", "table.b")
    with pytest.raises(KeyError, match="element 'mesh_9': unknown"):
        run.mode("mesh_9")


def test_events_are_where_the_modes_change(run: Run) -> None:
    flanks = {"back": -1, "gap": 0, "front": 1}
    events = [event for event in run.events if event.element == "mesh_1"]
    assert events
    mode = run.mode("mesh_1")
    for event in events:
        before, after = np.searchsorted(run.t, event.t) - 1, np.searchsorted(run.t, event.t) + 1
        inside = [e for e in events if run.t[before] <= e.t <= run.t[after]]
        assert mode[before] == flanks[inside[0].from_]
        assert mode[after] == flanks[inside[-1].to]
    assert np.array_equal(mode, run["mesh_1.flank"])


def test_a_sensitivity_is_the_slope_between_two_runs(run: Run) -> None:
    m = Machine.load()
    nominal = m.get("table.J")
    step = 1e-3 * nominal
    below, above = m.copy(), m.copy()
    below.set("table.J", nominal - step)
    above.set("table.J", nominal + step)
    slope = (simulate(above, MOVE)["e"] - simulate(below, MOVE)["e"]) / (2 * step)
    found = run.sensitivity("e", "table.J")
    assert found == pytest.approx(slope, abs=2e-3 * np.abs(slope).max())


def test_the_machine_of_a_run_does_not_change_with_its_original() -> None:
    m = Machine.load()
    run = simulate(m, MOVE, end=0.01)
    m.set("table.J", 1e6)
    assert run.machine.get("table.J") == 4.95e6


def test_only_what_is_asked_for() -> None:
    run = simulate(Machine.load(), MOVE, signals=["theta_m", "T_1"], times=[0.0, 1.0, 2.5])
    assert run.names == ("theta_m", "T_1")
    assert run.values.shape == (3, 2)
    assert run.t.tolist() == [0.0, 1.0, 2.5]


def test_a_run_that_fails_says_so_and_keeps_what_it_has() -> None:
    run = simulate(Machine.load("heavy-table-550t"), MOVE, max_steps=50)
    assert not run.ok
    assert run.status == "too_many_steps"
    assert run.message
    assert 0 < run.t.size < 3001


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"end": -1.0}, "end = -1"),
        ({"signals": ["theta_x"]}, "no signal named theta_x"),
        ({"initial": {"speed": 1.0}}, "no such state"),
        ({"sensitivities": ["table.K"]}, "parameter table.K: unknown"),
        ({"method": "euler"}, "choose one of auto, adams, bdf"),
        ({"output_step": 0.0}, "output_step"),
        ({"rtol": -1.0}, "rtol"),
        ({"times": [0.0, 1.0, 1.0]}, "times"),
        ({"load": float("nan")}, "constant"),
    ],
)
def test_options_that_make_no_sense(options: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        simulate(Machine.load(), MOVE, **options)


def test_without_motion_and_controller_nothing_says_when_to_stop() -> None:
    m = Machine.load("bench")
    m.set("controller.kind", "none")
    with pytest.raises(ValueError, match="give end="):
        simulate(m)


# --- other forms ----------------------------------------------------------------------------------


def test_tables_carry_their_units(run: Run) -> None:
    frame = run.to_pandas()
    assert frame.index.name == "t"
    assert frame["e"].to_numpy() == pytest.approx(run["e"])
    assert frame.attrs["units"]["e"] == "rad"
    data = run.to_xarray()
    assert data["T_1"].attrs["units"] == "N*m"
    assert data["T_1"].attrs["long_name"]
    assert float(data["theta_m"].sel(t=2.0, method="nearest")) == pytest.approx(
        run["theta_m"][2000]
    )
    events = run.events_frame()
    assert list(events.columns) == ["t", "element", "from", "to"]
    assert len(events) == len(run.events)


def test_a_notebook_shows_what_a_run_is(run: Run) -> None:
    page = run._repr_html_()
    assert "heavy-table-100t" in page
    assert "success" in page
    assert MOVE.text in page


def test_a_run_can_be_sent_to_another_process(run: Run) -> None:
    same(pickle.loads(pickle.dumps(run)), run)


# --- files ----------------------------------------------------------------------------------------


def test_a_file_gives_the_run_back(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path / "run.h5", command="dualdrive simulate")
    same(load_run(tmp_path / "run.h5"), run)


def test_a_recorded_motion_comes_back_with_its_points(tmp_path: Path) -> None:
    t = np.linspace(0, 1, 11)
    motion = sampled(t, 1e-3 * np.sin(t))
    run = simulate(Machine.load("bench"), motion)
    run.save(tmp_path / "run.h5")
    same(load_run(tmp_path / "run.h5"), run)


def test_the_file_explains_itself(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    run.save(path, command="dualdrive simulate -o run.h5")
    with h5py.File(path) as file:
        assert file.attrs["schema"] == "dualdrive result 1"
        assert file.attrs["version"] == dualdrive.__version__
        assert file.attrs["command"] == "dualdrive simulate -o run.h5"
        assert Machine.from_toml(file.attrs["machine"]).get("table.J") == 4.95e6
        datasets = []
        file.visititems(lambda _, x: datasets.append(x) if isinstance(x, h5py.Dataset) else None)
        assert len(datasets) > 60
        for item in datasets:
            assert "unit" in item.attrs, item.name
            assert item.attrs["long_name"], item.name
        assert file["run/T_1"].dims[0][0] == file["run/t"]
    with xr.open_dataset(path, group="run", engine="h5netcdf") as data:
        assert data["T_1"].dims == ("t",)
        assert data["T_1"].attrs["units"] == "N*m"
        assert data["T_1"].to_numpy() == pytest.approx(run["T_1"])
        slope = data["sensitivities"].sel(signal="e", parameter="table.J")
        assert slope.to_numpy() == pytest.approx(run.sensitivity("e", "table.J"))


def test_a_file_is_replaced_only_when_asked(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    path.write_text("mine")
    with pytest.raises(FileError, match=r"run\.h5: exists already"):
        run.save(path)
    assert path.read_text() == "mine"
    run.save(path, overwrite=True)
    assert load_run(path).ok


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("nowhere/run.h5", "there is no folder"),
        ("/dev/full", "not a regular file"),
        (".", "not a regular file"),
    ],
)
def test_a_place_that_cannot_be_written(run: Run, tmp_path: Path, name: str, told: str) -> None:
    with pytest.raises(FileError, match=told) as refused:
        run.save(tmp_path / name, overwrite=True)
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_leaves_what_was_there(tmp_path: Path) -> None:
    """The system's limit on a file's size stands for the disk: the same error path."""
    path = tmp_path / "run.h5"
    path.write_text("the old one")
    code = (
        "import sys, dualdrive\n"
        "run = dualdrive.simulate(dualdrive.Machine.load(), end=1.0)\n"
        "try:\n    run.save(sys.argv[1], overwrite=True)\n"
        "except dualdrive.FileError as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)],
        capture_output=True,
        text=True,
        preexec_fn=full_disk(65536),
    )
    assert done.stdout == f"{path}: cannot be written: File too large; nothing was changed there\n"
    assert done.returncode == 0, done.stderr
    assert path.read_text() == "the old one"
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


def test_files_that_are_no_run(run: Run, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        load_run(tmp_path / "none.h5")
    text = tmp_path / "text.h5"
    text.write_text("no HDF5 at all")
    with pytest.raises(FileError, match=r"text\.h5: not a readable HDF5 file"):
        load_run(text)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = [1, 2]
    with pytest.raises(FileError, match="holds no run"):
        load_run(tmp_path / "other.h5")
    whole = tmp_path / "run.h5"
    run.save(whole)
    half = tmp_path / "half.h5"
    half.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(FileError, match=r"half\.h5: not a readable HDF5 file"):
        load_run(half)


@pytest.mark.parametrize("engine", ["exact", "cvode"])
@pytest.mark.parametrize("zero", [0, 0.0, -0.0, np.float64(0)])
def test_a_load_of_zero_is_none_to_the_same_bits(zero: float, engine: str) -> None:
    machine = Machine.load("bench")
    motion = parse_motion("move:0.1,v=1,a=20,end=0.3")
    with_zero, without = (simulate(machine, motion, load=x, engine=engine) for x in (zero, None))
    assert with_zero.names == without.names
    for name in without.names:
        np.testing.assert_array_equal(with_zero[name], without[name], strict=True)
