"""Sweeps from Python: the grid, what the file says, and that threads change nothing."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr

import dualdrive
from dualdrive.figures import figures
from dualdrive.files import FileError
from dualdrive.machine import Machine
from dualdrive.motion import Motion, move, sampled, sine
from dualdrive.simulation import simulate
from dualdrive.sweeps import (
    GridError,
    Sweep,
    Threads,
    lay_out,
    load_sweep,
    resume,
    sweep,
)
from dualdrive.sweeps.plan import Plan

MOTION = move(0.01, v=0.03, a=0.01, j=0.05, start=1.0, end=4.5)
AXES: dict[str, Any] = {"meshes.gap": [0.0, 1.1e-3, 2.2e-3], "controller.T_ten": "0,60"}


@pytest.fixture(scope="module")
def machine() -> Machine:
    return Machine.load("heavy-table-250t")


@pytest.fixture(scope="module")
def path(machine: Machine, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished sweep of 3 x 2 runs with one signal kept whole."""
    path = tmp_path_factory.mktemp("sweep") / "sweep.h5"
    sweep(machine, AXES, motion=MOTION, output=path, keep=["theta_m"], command="as typed").close()
    return path


@pytest.fixture
def swept(path: Path) -> Iterator[Sweep]:
    with load_sweep(path) as swept:
        yield swept


# --- the grid -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "given", "values"),
    [
        pytest.param("delta", "0:1e-3:5", [0, 0.25e-3, 0.5e-3, 0.75e-3, 1e-3], id="ends included"),
        pytest.param("meshes.gap", "0,1.1mrad", [0, 1.1e-3], id="list with units"),
        pytest.param("mesh_1.gap", "0:180arcsec:2", [0, np.pi / 3600], id="range with units"),
        pytest.param("controller.T_ten", "0:60%:3", [0, 30, 60], id="of the rated 100 N m"),
        pytest.param("controller.T_ten", ["10%", 25.0], [10, 25], id="texts and numbers"),
        pytest.param("table.J", np.array([3e6, 1e6]), [3e6, 1e6], id="array, falling"),
        pytest.param("controller.w", 0.5, [0.5], id="one value"),
    ],
)
def test_values_of_an_axis(machine: Machine, name: str, given: Any, values: list[float]) -> None:
    (axis,) = lay_out(machine, {name: given}).axes
    np.testing.assert_allclose(axis.values, values, rtol=1e-14)
    assert axis.unit == machine.parameter(axis.path).unit


def test_the_half_gap_of_every_mesh_is_called_delta(machine: Machine) -> None:
    (axis,) = lay_out(machine, {"delta": "0,1e-3"}).axes
    assert (axis.path, axis.members) == ("meshes.gap", ("mesh_1.gap", "mesh_2.gap"))


def test_runs_are_numbered_row_by_row(machine: Machine) -> None:
    grid = lay_out(machine, AXES)
    assert (grid.shape, grid.size) == ((3, 2), 6)
    assert grid.point(3) == {"meshes.gap": 1.1e-3, "controller.T_ten": 60.0}
    one = grid.machine(machine, 3)
    assert (one.get("mesh_2.gap"), one.get("controller.T_ten")) == (1.1e-3, 60.0)
    assert machine.get("meshes.gap") == Machine.load("heavy-table-250t").get("meshes.gap")


@pytest.mark.parametrize(
    ("axes", "says"),
    [
        ({}, "no axis to sweep"),
        ({"meshes.gap": []}, "meshes.gap: no values"),
        ({"meshes.gap": "0:1e-3:0"}, "count of at least 1"),
        ({"meshes.gap": "0:1e-3:1"}, "one point cannot include both ends"),
        ({"meshes.gap": "1,,2"}, "empty value"),
        ({"meshes.gap": [0.0, float("nan")]}, "must be finite"),
        ({"meshes.gap": "nan,1"}, "not a number"),
        ({"meshes.gap": [0.0, 1e-3, 0.0]}, "0 rad occurs more than once"),
        ({"meshes.gap": "0,-1e-3"}, "must be at least 0"),
        ({"meshes.gap": "0,1kg"}, "kg does not measure rad"),
        ({"meshes.gaps": "0,1"}, "did you mean"),
        ({"delta": "0,1", "meshes.gap": "0,1"}, "mesh_1.gap, as delta does"),
        ({"meshes.gap": "0,1", "mesh_2.gap": "0,1"}, "mesh_2.gap, as meshes.gap does"),
        ({"meshes.gap": "0:1:1000000000000000000"}, "at most 1,000,000 points"),
        ({"meshes.gap": "0:1:100000", "table.J": "1:2:1000"}, "100,000,000 runs"),
    ],
)
def test_axes_that_make_no_sense(machine: Machine, axes: dict[str, Any], says: str) -> None:
    with pytest.raises(GridError) as caught:
        lay_out(machine, axes)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


# --- what is in the file --------------------------------------------------------------------------


def test_every_run_is_the_simulation_of_its_machine(machine: Machine, swept: Sweep) -> None:
    data = swept.dataset
    for gap in (0.0, 2.2e-3):
        for tension in (0.0, 60.0):
            one = machine.copy()
            one.set("meshes.gap", gap)
            one.set("controller.T_ten", tension)
            run = simulate(one, MOTION)
            cell = data.sel({"meshes.gap": gap, "controller.T_ten": tension})
            assert cell["status"] == "success"
            for name, value in figures(run).items():
                assert cell[name] == pytest.approx(value, rel=1e-6, abs=1e-12), name
            np.testing.assert_allclose(cell["t"], run.t, atol=1e-12)
            np.testing.assert_allclose(cell["theta_m"], run["theta_m"], rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("engine", [None, "h5netcdf"])
def test_xarray_opens_it_with_labelled_axes(path: Path, engine: Any) -> None:
    with xr.open_dataset(path, engine=engine) as data:
        assert dict(data.sizes) == {"meshes.gap": 3, "controller.T_ten": 2, "t": 4501}
        np.testing.assert_array_equal(data["meshes.gap"], AXES["meshes.gap"])
        assert data["peak_error"].dims == ("meshes.gap", "controller.T_ten")
        assert data["theta_m"].dims == ("meshes.gap", "controller.T_ten", "t")
        assert set(data["status"].values.ravel()) == {"success"}
        assert data["message"].values.ravel().tolist() == [""] * 6
        for name, variable in data.variables.items():
            assert {"unit", "units", "long_name"} <= set(variable.attrs), name
            assert variable.attrs["long_name"], name
        units = {"meshes.gap": "rad", "controller.T_ten": "N*m", "peak_error": "rad", "t": "s"}
        assert {name: data[name].attrs["units"] for name in units} == units


def test_root_attributes_say_where_it_comes_from(machine: Machine, path: Path) -> None:
    with h5py.File(path) as file:
        attributes = dict(file.attrs)
        assert file["peak_error"].dims[0].keys() == ["meshes.gap"]
    assert attributes["schema"] == "dualdrive sweep 1"
    assert attributes["version"] == dualdrive.__version__
    assert attributes["command"] == "as typed"
    assert attributes["motion"] == MOTION.text
    assert (attributes["rtol"], attributes["method"]) == (1e-10, "auto")
    assert "energy_error" in attributes["error"]
    again = Machine.from_toml(attributes["machine"])
    assert [p.value for p in again.parameters()] == [p.value for p in machine.parameters()]


def test_energy_closes_in_every_run(swept: Sweep) -> None:
    """The error the solver reached, not the tolerance it was given; a smooth run stays below."""
    error = swept.dataset["energy_error"].values
    assert (error > 0).all()
    assert (error < 1e-7).all()


def test_a_sweep_without_the_balance_has_the_other_figures(machine: Machine, swept: Sweep) -> None:
    with sweep(machine, AXES, motion=MOTION, energy=False, engine="exact") as quick:
        assert np.isnan(quick.dataset["energy_error"]).all()
        for name in ("peak_error", "rms_error", "motor_2.torque_rms"):
            np.testing.assert_allclose(quick.dataset[name], swept.dataset[name], rtol=1e-9)
        assert (quick.dataset["events"] == swept.dataset["events"]).all()


def test_the_result_reads_well(swept: Sweep) -> None:
    assert repr(swept) == f"<Sweep {swept.path}: meshes.gap: 3, controller.T_ten: 2>"
    assert "peak_error" in swept._repr_html_()
    frame = swept.to_pandas()
    assert frame.index.names == ["meshes.gap", "controller.T_ten"]
    assert frame.loc[(2.2e-3, 0.0), "events"] == swept.dataset["events"].values[2, 0]
    entry = json.loads(json.dumps(swept.to_dict(), allow_nan=False))["runs"][5]
    assert (entry["meshes.gap"], entry["controller.T_ten"]) == (2.2e-3, 60.0)
    assert entry["peak_error"] == swept.dataset["peak_error"].values[2, 1]


def test_without_a_file_the_grid_lives_as_long_as_its_object(machine: Machine) -> None:
    swept = sweep(machine, {"delta": "0,1e-3"}, motion=MOTION)
    where = swept.path
    assert np.isfinite(swept.dataset["rms_error"]).all()
    swept.close()
    del swept
    assert not where.exists()


def test_pictures(swept: Sweep, machine: Machine) -> None:
    figure = swept.plot("peak_error")
    panel, bar = figure.axes
    assert panel.get_xlabel().startswith("meshes.gap [")
    assert panel.get_ylabel() == "controller.T_ten [N·m]"
    assert "peak error" in bar.get_ylabel()
    drawn: Any = panel.collections[0].get_array()
    unit = np.pi / 648000  # arc seconds
    np.testing.assert_allclose(drawn, swept.dataset["peak_error"].values.T / unit)
    with sweep(machine, {"table.J": [3e6, 4e6, 0.0]}, motion=MOTION) as line:
        torques, errors = line.plot(["motor_1.torque_rms", "rms_error"]).axes
        shown = torques.lines[0].get_ydata()
        np.testing.assert_array_equal(shown, line.dataset["motor_1.torque_rms"])
        assert errors.get_xlabel() == "table.J [kg·m²]"


# --- failures -------------------------------------------------------------------------------------


def test_a_failed_run_carries_its_status_and_stops_no_other(machine: Machine) -> None:
    """No inertia is refused, an absurd gain runs out of steps; a gap of 0 is nothing special."""
    axes = {"table.J": [0.0, 1e7], "controller.K_v": [5.0, 1e9], "delta": [0.0, 1e-3]}
    with sweep(machine, axes, motion=MOTION, max_steps=7000, engine="cvode") as swept:
        status = swept.dataset["status"].values
        assert (status[0] == "refused").all()
        assert (status[1, 0] == "success").all()
        assert (status[1, 1] == "too_many_steps").all()
        assert swept.pending == 0
        message = swept.dataset["message"].values
        assert "table" in message[0, 0, 0]
        assert "steps" in message[1, 1, 0]
        peak = swept.dataset["peak_error"].values
        np.testing.assert_array_equal(np.isfinite(peak), status == "success")
        assert len(swept.failed) == 6
        assert swept.failed[0][0] == {"table.J": 0.0, "controller.K_v": 5.0, "meshes.gap": 0.0}


# --- threads --------------------------------------------------------------------------------------


def test_results_do_not_depend_on_the_number_of_threads(machine: Machine) -> None:
    found = []
    for jobs in (1, 2, 5):
        with sweep(machine, {"delta": "0:2mrad:9"}, motion=MOTION, jobs=jobs) as swept:
            names = [name for name in swept.figures if name != "speed"]
            found.append([swept.dataset[name].values.tobytes() for name in names])
    assert found[0] == found[1] == found[2]


def test_simulations_leave_the_interpreter_to_others(machine: Machine) -> None:
    """While one thread simulates, another goes on: so threads use all cores.

    Without that the counting thread would get nothing done from begin to end of the simulation.
    """
    at_work, moments = threading.Event(), [0.0]

    def compute() -> None:
        at_work.set()
        began = time.perf_counter()
        simulate(machine, sine(1e-3, f=1.0), end=200.0, signals=["e"], output_step=0.1)
        moments[:] = [began, time.perf_counter()]

    worker = threading.Thread(target=compute)
    ticks = []
    worker.start()
    at_work.wait()
    while worker.is_alive():
        ticks.append(time.perf_counter())
        time.sleep(1e-4)
    begin, end = moments
    assert sum(begin < t < end for t in ticks) > 10


def test_a_stop_hands_over_what_is_under_way_and_no_more(machine: Machine) -> None:
    """With whole signals kept, two runs per thread at most are begun and not handed over."""
    grid, stop = lay_out(machine, {"delta": "0:2mrad:40"}), threading.Event()
    plan = Plan(machine, MOTION, grid, 0.0, 4.5, 1e-3, 1e-9, "auto", keep=("e",))
    handed = []
    for batch in Threads(2).outcomes(plan, range(40), stop):
        stop.set()
        handed += batch
    assert {outcome.status for outcome in handed} == {"success"}
    assert 1 <= len(handed) <= 8
    assert sorted(outcome.run for outcome in handed) == list(range(len(handed)))


def test_a_sweep_has_the_bits_of_single_runs(machine: Machine, swept: Sweep) -> None:
    """At the same output times: figures and kept signals of `simulate`, to the last digit."""
    for number in (0, 3, 5):
        one = machine.copy()
        for name, value in swept.point(number).items():
            one.set(name, value)
        run = simulate(one, MOTION, times=swept.dataset["t"].values, signals=["e", "T_1", "T_2"])
        for name, value in figures(run).items():
            assert swept.dataset[name].values.flat[number] == value, name


# --- files that are there already -----------------------------------------------------------------


def test_a_file_is_not_overwritten_unless_it_may_be(machine: Machine, path: Path) -> None:
    content = path.read_bytes()
    with pytest.raises(FileError, match="exists already"):
        sweep(machine, {"delta": "0,1e-3"}, motion=MOTION, output=path)
    assert path.read_bytes() == content


def test_overwriting_replaces_it(machine: Machine, tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    for values in ("0,1e-3", "0:1e-3:3"):
        sweep(machine, {"delta": values}, motion=MOTION, output=path, overwrite=True)
    assert load_sweep(path).shape == (3,)


def changed_machine(machine: Machine, path: str, value: float) -> Machine:
    other = machine.copy()
    other.set(path, value)
    return other


def with_effect(machine: Machine) -> Machine:
    other = machine.copy()
    other.add("viscous@table")
    return other


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (lambda m: {"machine": changed_machine(m, "table.J", 1e7)}, "table.J: "),
        (lambda m: {"machine": changed_machine(m, "table.b", 1e5 + 1e-6)}, "100000.000001 here"),
        (lambda m: {"machine": with_effect(m)}, "machine.effects: "),
        (lambda _: {"machine": "bench"}, " there, "),
        (lambda _: {"motion": "move:0.02,v=0.03,a=0.01,j=0.05,start=1,end=4.5"}, "motion: "),
        (lambda _: {"axes": {"delta": AXES["meshes.gap"]}}, "axes: meshes.gap, controller.T_ten"),
        (lambda _: {"axes": AXES | {"controller.T_ten": "0,30,60"}}, "2 values there, 3 here"),
        (lambda _: {"axes": AXES | {"controller.T_ten": "0,61"}}, "60 N·m there, 61 N·m here"),
        (lambda _: {"axes": dict(reversed(AXES.items()))}, "axes: "),
        (lambda _: {"keep": ()}, "keep: theta_m there, none here"),
        (lambda _: {"end": 2.0}, "4.5 there"),
        (lambda _: {"load": 5e3}, "load: 0.0 there, 5000.0 here"),
        (lambda _: {"rtol": 1e-8}, "rtol: 1e-10 there, 1e-08 here"),
        (lambda _: {"method": "bdf"}, "method: auto there, bdf here"),
        (lambda _: {"engine": "cvode"}, "engine: auto there, cvode here"),
        (lambda _: {"energy": False}, "energy: True there, False here"),
    ],
)
def test_resume_refuses_another_sweep_and_names_what_differs(
    machine: Machine, path: Path, change: Any, names: str
) -> None:
    same: dict[str, Any] = {"machine": machine, "axes": AXES, "motion": MOTION, "keep": ["theta_m"]}
    with pytest.raises(FileError, match="is a sweep of something else") as caught:
        sweep(**(same | change(machine)), output=path, resume=True)
    assert names in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["version", "core"])
def test_resume_refuses_another_package(machine: Machine, tmp_path: Path, name: str) -> None:
    path = tmp_path / "sweep.h5"
    axes = {"delta": "0,1e-3"}
    sweep(machine, axes, motion=MOTION, output=path)
    with h5py.File(path, "r+") as file:
        file.attrs[name] = "0.0.9"
    with pytest.raises(FileError, match=f"{name}: 0.0.9 there, "):
        sweep(machine, axes, motion=MOTION, output=path, resume=True)


def test_the_value_a_swept_parameter_had_before_does_not_matter(
    machine: Machine, path: Path
) -> None:
    other = changed_machine(machine, "meshes.gap", 1.9e-3)
    swept = sweep(other, AXES, motion=MOTION, keep=["theta_m"], output=path, resume=True)
    assert swept.pending == 0


def test_a_recorded_motion_is_told_apart_by_its_values(machine: Machine, tmp_path: Path) -> None:
    def recorded(scale: float) -> Motion:
        t = np.linspace(0.0, 3.0, 31)
        return sampled(t, scale * (1 - np.cos(t)))

    path, axes = tmp_path / "sweep.h5", {"delta": "0,1e-3"}
    sweep(machine, axes, motion=recorded(1e-3), output=path)
    assert sweep(machine, axes, motion=recorded(1e-3), output=path, resume=True).pending == 0
    with pytest.raises(FileError, match="motion: "):
        sweep(machine, axes, motion=recorded(1.1e-3), output=path, resume=True)
    with pytest.raises(GridError, match="its motion was sampled"):
        resume(path)


def test_a_file_alone_says_how_it_is_completed(path: Path) -> None:
    assert resume(path).pending == 0


def test_resume_without_a_file_begins_it(machine: Machine, tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    assert sweep(machine, {"delta": "0,1e-3"}, motion=MOTION, output=path, resume=True).pending == 0


@pytest.mark.parametrize("content", [b"", b"not HDF5 at all", None])
def test_a_file_that_is_no_sweep(machine: Machine, tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "other.h5"
    if content is None:
        simulate(machine, MOTION, end=0.01).save(path)
    else:
        path.write_bytes(content)
    before = path.read_bytes()
    with pytest.raises(FileError, match=r"other\.h5: is not a sweep"):
        sweep(machine, {"delta": "0,1e-3"}, output=path, resume=True)
    with pytest.raises(FileError, match=r"other\.h5: is not a sweep"):
        load_sweep(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"jobs": 0}, "jobs = 0: must be at least 1"),
        ({"end": 0.0}, "end = 0.0"),
        ({"output_step": 9.0}, "output_step = 9.0"),
        ({"rtol": 0.0}, "rtol = 0.0"),
        ({"max_steps": 0}, "max_steps = 0"),
        ({"engine": "steam"}, "engine = 'steam' is unknown"),
        ({"keep": ["theta_n"]}, "take theta_m"),
        ({"load": float("inf")}, "load = inf"),
        ({"motion": "moev:1"}, "'moev' is unknown"),
        ({"machine": "hevy-table"}, "no such file, and no preset"),
    ],
)
def test_what_cannot_be_asked_leaves_no_file(
    machine: Machine, tmp_path: Path, wrong: dict[str, Any], says: str
) -> None:
    path = tmp_path / "sweep.h5"
    axes = {"delta": "0,1e-3"}
    given: dict[str, Any] = {"machine": machine, "axes": axes, "motion": MOTION, "output": path}
    with pytest.raises(ValueError, match=says.replace("(", r"\(")) as caught:
        sweep(**(given | wrong))
    assert "\n" not in str(caught.value)
    assert not path.exists()
