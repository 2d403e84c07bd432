"""Sweeps from Python: what the file says, runs that fail, and that threads change nothing."""

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
from dualdrive.machine import Machine
from dualdrive.motion import sine
from dualdrive.simulation import simulate
from dualdrive.sweeps import Sweep, Threads, lay_out, load_sweep, sweep
from dualdrive.sweeps.plan import Plan
from small_sweep import AXES, MOTION, swept_file, table


@pytest.fixture(scope="module")
def machine() -> Machine:
    return table()


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept_file(tmp_path_factory.mktemp("sweep"))


@pytest.fixture
def swept(path: Path) -> Iterator[Sweep]:
    with load_sweep(path) as swept:
        yield swept


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
