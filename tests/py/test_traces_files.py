"""HDF5 and MAT files, made here with the libraries that others write them with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from dualdrive.traces import ColumnRule, FileLayout, TimeRule, TraceError, TraceMap, read

T = np.arange(20) * 0.01


def write_runs(path: Path, **groups: str) -> Path:
    """A result file: groups with t and channels, unit and long_name on every dataset."""
    with h5py.File(path, "w") as file:
        for name, unit in groups.items():
            group = file if name == "root" else file.create_group(name.replace("__", "/"))
            group["t"] = T
            group["theta_m"] = 3.0 * T
            group["mesh_1.twist"] = T**2
            group["t"].attrs["unit"] = "s"
            group["theta_m"].attrs.update({"unit": unit, "long_name": "table angle, simulated"})
            group["mesh_1.twist"].attrs["unit"] = np.bytes_("mrad")
            group["status"] = "completed"
    return path


@pytest.mark.parametrize("place", ["root", "run_1", "grid__run_7"])
def test_a_run_is_read_as_a_trace(tmp_path: Path, place: str) -> None:
    trace = read(write_runs(tmp_path / "run.h5", **{place: "deg"}))
    np.testing.assert_allclose(trace.t, T)
    np.testing.assert_allclose(trace["theta_m"], np.radians(3 * T))
    np.testing.assert_allclose(trace["mesh_1.twist"], 1e-3 * T**2)
    assert trace.long_names["theta_m"] == "table angle, simulated"
    assert trace.rows[0] == 1


def test_several_runs_must_be_told_apart(tmp_path: Path) -> None:
    path = write_runs(tmp_path / "run.h5", run_1="rad", run_2="deg")
    with pytest.raises(TraceError, match="2 groups hold a recording; name one of: run_1, run_2"):
        read(path)
    np.testing.assert_allclose(read(path, group="run_2")["theta_m"], np.radians(3 * T))
    mapping = TraceMap(file=FileLayout(group="run_1"))
    np.testing.assert_allclose(read(path, mapping)["theta_m"], 3 * T)
    with pytest.raises(TraceError, match="no group 'run_3'; the file has: run_1, run_2"):
        read(path, group="run_3")


def test_the_events_of_a_run_are_no_recording_of_their_own(tmp_path: Path) -> None:
    """What `simulate -o` writes is read as it is."""
    path = write_runs(tmp_path / "run.h5", run="deg", run__events="rad")
    np.testing.assert_allclose(read(path)["theta_m"], np.radians(3 * T))


def test_foreign_hdf5_with_a_clock_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "x.hdf5"
    with h5py.File(path, "w") as file:
        file["scope/time"] = 1e3 * T
        file["scope/pos"] = T
        file["scope/both"] = np.column_stack([T, 2 * T])
    mapping = TraceMap(
        time=TimeRule(column="time", unit="ms"),
        columns={"pos": ColumnRule(channel="theta_m"), "both[2]": ColumnRule(channel="T_1")},
    )
    trace = read(path, mapping)
    np.testing.assert_allclose(trace.t, T)
    np.testing.assert_allclose(trace["T_1"], 2 * T)


def test_no_hdf5_after_all(tmp_path: Path) -> None:
    path = tmp_path / "x.h5"
    path.write_text("t,theta_m\n0,1\n")
    with pytest.raises(TraceError, match=r"^x\.h5: not a readable HDF5 file"):
        read(path)
    path.write_bytes(b"")
    with pytest.raises(TraceError, match="empty"):
        read(path)


def test_half_a_file(tmp_path: Path) -> None:
    whole = write_runs(tmp_path / "run.h5", root="rad").read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(TraceError, match=r"^cut\.h5: not a readable HDF5 file"):
        read(tmp_path / "cut.h5")


VARIABLES: dict[str, Any] = {
    "t": T[:, None],
    "qm": 100 * T[:, None],
    "speeds": np.column_stack([T, -T]).T,
    "gain": 35.15,
    "title": "axis C",
    "short": np.arange(3.0),
}
MAPPING = TraceMap(
    columns={
        "qm": ColumnRule(channel="theta_m", unit="deg"),
        "speeds[2]": ColumnRule(channel="omega_m", sign=-1, wrap=False),
    }
)


def test_mat_5(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    savemat(path, VARIABLES)
    trace = read(path, MAPPING)
    np.testing.assert_allclose(trace.t, T)
    np.testing.assert_allclose(trace["theta_m"], np.radians(100 * T))
    np.testing.assert_allclose(trace["omega_m"], T)
    np.testing.assert_allclose(trace["speeds[1]"], T)
    assert dict(trace.constants) == {"gain": 35.15}
    assert "'short'" in str(trace.log["text_column"][0])


def test_mat_5_structures(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    savemat(path, {"run": {"time": T, "axis": {"pos": T}}, "other": np.arange(50.0)})
    mapping = TraceMap(
        file=FileLayout(group="run"),
        time=TimeRule(column="time"),
        columns={"axis.pos": ColumnRule(channel="theta_m")},
    )
    np.testing.assert_allclose(read(path, mapping)["theta_m"], T)
    with pytest.raises(TraceError, match="no variable 'walk'; the file has: other, run"):
        read(path, group="walk")


def test_mat_7_3(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name in ("t", "qm", "speeds"):
            file[name] = np.asarray(VARIABLES[name]).T  # as MATLAB stores it
        file["gain"] = np.array([[35.15]])
        file["square"] = np.outer(T**2, np.arange(len(T))).T
        file["#refs#/a"] = np.arange(7.0)
    with path.open("rb+") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64")
    trace = read(path, MAPPING)
    np.testing.assert_allclose(trace["theta_m"], np.radians(100 * T))
    np.testing.assert_allclose(trace["omega_m"], T)
    np.testing.assert_allclose(trace["square[4]"], 3 * T**2)
    assert dict(trace.constants) == {"gain": 35.15}
    assert trace.source.layout["format"] == "mat 7.3"


def test_no_mat_after_all(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    path.write_bytes(b"t,theta_m\n" * 100)
    with pytest.raises(TraceError, match=r"^x\.mat: not a readable MAT file"):
        read(path, MAPPING)
    savemat(path, {"title": "nothing"})
    with pytest.raises(TraceError, match="no arrays of numbers"):
        read(path, MAPPING)


def test_content_tells_the_format_where_the_name_does_not(tmp_path: Path) -> None:
    path = tmp_path / "recording"
    savemat(path, VARIABLES, appendmat=False)
    assert read(path, MAPPING).source.layout["format"] == "mat"
    write_runs(path, root="rad")
    assert read(path).source.layout["format"] == "hdf5"
    path.write_text("t,theta_m\n0,1\n1,2\n")
    assert read(path).source.layout["format"] == "csv"
