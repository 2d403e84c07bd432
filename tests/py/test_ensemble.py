"""Ensembles from Python: single runs to the last bit on any threads, nothing lost, bounded."""

from __future__ import annotations

import _thread
import math
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine, MachineError, ensemble, simulate
from dualdrive.ensembles import Ensemble, Outcome
from dualdrive.figures import declared, figures
from dualdrive.motion import Motion, move, sine

MOTION = move(0.01, v=0.03, a=0.01, j=0.05, start=0.2, end=3.0)
GAPS = np.array([0.0, 4e-4, 1.1e-3, 2.2e-3, 3e-3])


@pytest.fixture(scope="module")
def machine() -> Machine:
    return Machine.load("heavy-table-250t")


def begin(machine: Machine, count: int = 5, **options: Any) -> Ensemble:
    motion = options.pop("motion", MOTION)
    return ensemble(machine, motion, {"meshes.gap": np.linspace(0.0, 3e-3, count)}, **options)


def by_number(runs: Ensemble) -> list[Outcome]:
    return sorted(runs, key=lambda one: one.run)


def bits(one: Outcome) -> bytes:
    numbers = [value for name, value in one.figures.items() if name != "speed"]
    kept = b"".join(np.ascontiguousarray(x).tobytes() for x in (one.signals or {}).values())
    return np.array(numbers).tobytes() + kept


# --- the same as single runs ----------------------------------------------------------------------


def test_every_run_is_its_own_simulation_to_the_last_bit(machine: Machine) -> None:
    values: dict[str, Any] = {"meshes.gap": GAPS, "controller.T_ten": GAPS * 2e4, "table.J": 4e6}
    runs = ensemble(machine, MOTION, values, load=500.0, keep=["theta_m", "T_2"], rtol=1e-9)
    assert len(runs) == 5
    for one in runs:
        single = machine.copy()
        single.set("meshes.gap", GAPS[one.run])
        single.set("controller.T_ten", GAPS[one.run] * 2e4)
        single.set("table.J", 4e6)
        run = simulate(
            single, MOTION, load=500.0, rtol=1e-9, signals=["theta_m", "T_2", "e", "T_1"]
        )
        assert one.status == run.status == "success"
        assert {k: v for k, v in one.figures.items() if k != "speed"} == figures(run)
        assert one.signals is not None
        for name in ("theta_m", "T_2"):
            assert one.signals[name].tobytes() == np.ascontiguousarray(run[name]).tobytes()
        np.testing.assert_array_equal(runs.t, run.t)


@pytest.mark.parametrize("ordered", [False, True])
def test_threads_and_order_change_no_bit(machine: Machine, ordered: bool) -> None:
    reference = [bits(one) for one in by_number(begin(machine, 12, jobs=1, keep=["e"]))]
    for jobs in (2, 5):
        found = list(begin(machine, 12, jobs=jobs, keep=["e"], ordered=ordered))
        if ordered:
            assert [one.run for one in found] == list(range(12))
        assert [bits(one) for one in sorted(found, key=lambda one: one.run)] == reference


def test_motions_loads_and_initial_states_may_differ(machine: Machine) -> None:
    motions = [MOTION, sine(1e-3, f=0.5, end=3.0)]
    loads: list[Any] = [0.0, 3000.0]
    runs = ensemble(machine, motions, {"initial.omega_m": [0.0, 1e-3]}, load=loads)
    for one in runs:
        initial = {"omega_m": 1e-3 * one.run}
        run = simulate(
            machine, motions[one.run], load=loads[one.run], initial=initial, end=runs.t[-1]
        )
        for name, value in figures(run).items():
            assert one.figures[name] == pytest.approx(value, nan_ok=True, abs=0.0, rel=0.0), name
    assert math.isnan(by_number(ensemble(machine, motions))[1].figures["standstill_amplitude"])


def test_measures_sum_up_what_is_asked(machine: Machine) -> None:
    wanted = {
        "late": ("e", "peak", 2.0),
        "swing": ("theta_m", "range", 0.5, 1.5),
        "end": ("theta_m", "final"),
        "usual": ("T_1", "mean", 0.2, 0.21),
    }
    (one,) = begin(machine, 1, measures=wanted)
    single = machine.copy()
    single.set("meshes.gap", 0.0)
    run = simulate(single, MOTION)
    t = run.t
    assert one.figures["late"] == np.abs(run["e"][t >= 2.0]).max()
    assert one.figures["swing"] == np.ptp(run["theta_m"][(t >= 0.5) & (t <= 1.5)])
    assert one.figures["end"] == run["theta_m"][-1]
    inside = (t >= 0.2) & (t <= 0.21)
    mean = np.trapezoid(run["T_1"][inside], t[inside]) / np.ptp(t[inside])
    assert one.figures["usual"] == pytest.approx(mean, rel=1e-12)


# --- all together ---------------------------------------------------------------------------------


def test_a_dataset_of_all_runs(machine: Machine) -> None:
    runs = begin(machine, 4, keep=["e", "T_1"], measures={"late": ("e", "peak", 2.0)})
    assert runs.pending == 4
    data = runs.dataset()
    assert (runs.pending, set(data["status"].values)) == (0, {"success"})
    assert data["e"].dims == ("run", "t")
    assert dict(data.sizes) == {"run": 4, "t": 3001}
    np.testing.assert_array_equal(data["meshes.gap"], np.linspace(0.0, 3e-3, 4))
    assert set(data.variables) >= {f.name for f in declared(machine)} | {"late", "speed"}
    units = {"e": "rad", "T_1": "N*m", "late": "rad", "meshes.gap": "rad", "t": "s"}
    assert {name: data[name].attrs["units"] for name in units} == units
    assert data["late"].attrs["long_name"].startswith("peak of ")
    for k, one in enumerate(by_number(begin(machine, 4, keep=["e", "T_1"]))):
        assert one.signals is not None
        np.testing.assert_array_equal(data["e"][k], one.signals["e"])
        assert data["rms_error"].values[k] == one.figures["rms_error"]
    assert "4 runs" in repr(runs)


def test_signals_are_with_who_took_them(machine: Machine) -> None:
    runs = begin(machine, 3, keep=["e"])
    next(iter(runs))
    with pytest.raises(ValueError, match="with who took them"):
        runs.dataset()
    assert set(begin(machine, 3).dataset()["status"].values) == {"success"}


def test_signals_are_views_that_outlive_the_ensemble_and_travel(machine: Machine) -> None:
    one = next(iter(begin(machine, 1, keep=["e", "T_1"])))
    assert one.signals is not None
    e = one.signals["e"]
    assert not e.flags.owndata
    assert not e.flags.writeable
    again = pickle.loads(pickle.dumps(one))
    assert again.signals["e"].tobytes() == e.tobytes()
    assert again.figures == one.figures


# --- failures -------------------------------------------------------------------------------------


def test_a_failed_run_is_its_own_affair(machine: Machine) -> None:
    """No inertia is refused, so is a gap below 0; too few steps end a run under way."""
    values = {"table.J": [1e7, 0.0, 1e7, 1e7], "meshes.gap": [1e-3, 1e-3, -1e-3, 2e-3]}
    data = ensemble(machine, MOTION, values, keep=["e"]).dataset()
    assert data["status"].values.tolist() == ["success", "refused", "refused", "success"]
    assert "inertia" in str(data["message"].values[1])
    assert "meshes.gap" in str(data["message"].values[2])
    ok = data["status"].values == "success"
    np.testing.assert_array_equal(np.isfinite(data["rms_error"]), ok)
    np.testing.assert_array_equal(np.isfinite(data["e"].values).all(axis=1), ok)
    np.testing.assert_array_equal(np.isfinite(data["speed"]), ok)
    (short,) = begin(machine, 1, method="bdf", max_steps=200, keep=["e"])
    assert short.status == "too_many_steps"
    assert short.signals is not None
    assert np.isfinite(short.signals["e"][0])
    assert np.isnan(short.signals["e"][-1])
    assert np.isnan(list(short.figures.values())).all()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"values": {"meshes.gop": [0.0]}}, "meshes.gap"),
        ({"values": {"meshes.gap": [[0.0]]}}, "2 dimensions"),
        (
            {"values": {"meshes.gap": [0.0, 1e-3], "table.J": [1e6] * 3}},
            "table.J: 3",
        ),
        ({"values": {"meshes.gap": [0.0, 1e-3]}, "load": [0.0] * 3}, "load: 3"),
        ({"values": {"meshes.preload": [1.0]}}, "nothing reads it"),
        ({"keep": ["theta_q"]}, "no signal 'theta_q'"),
        ({"measures": {"x": ("T_9", "peak")}}, "no signal 'T_9'"),
        ({"measures": {"x": ("e", "median")}}, "choose one of min, max"),
        ({"method": "euler"}, "method = 'euler'"),
        ({"jobs": 0}, "threads"),
        ({"output_step": 0.0}, "output_step = 0.0"),
        ({"values": {"meshes.gap": []}}, "no runs"),
    ],
)
def test_what_cannot_be_asked(machine: Machine, arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(MachineError) as caught:
        ensemble(machine, MOTION, **arguments)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


# --- interrupts and memory ------------------------------------------------------------------------


@pytest.fixture
def heard() -> Iterator[None]:
    """Ctrl-C is heard: a job in the background of a shell begins with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.long
@pytest.mark.usefixtures("heard")
def test_ctrl_c_loses_no_run_and_the_next_call_goes_on(machine: Machine) -> None:
    runs = begin(machine, 300, jobs=2)
    timer = threading.Timer(0.05, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        runs.dataset()
    stopped_with = runs.pending
    data = runs.dataset()
    assert set(data["status"].values) == {"success"}
    assert np.isfinite(data["rms_error"]).all()
    assert stopped_with > 0, "all was done before the interrupt: nothing was tested"
    uninterrupted = begin(machine, 300, jobs=1).dataset()
    np.testing.assert_array_equal(data["rms_error"], uninterrupted["rms_error"])


def test_an_iteration_that_was_left_goes_on_where_it_stopped(machine: Machine) -> None:
    runs = begin(machine, 30, jobs=2)
    handed = [next(iter(runs)).run for _ in range(7)]
    handed += [one.run for one in runs]
    assert sorted(handed) == list(range(30))


def test_a_stop_leaves_the_rest_pending(machine: Machine) -> None:
    runs = begin(machine, 200, jobs=2, keep=["e"])
    first = next(iter(runs))
    runs.stop()
    handed = [first, *runs]
    assert sorted(one.run for one in handed) == list(range(len(handed)))
    assert len(handed) <= 8
    assert runs.pending == 200 - len(handed)


def test_closing_ends_at_once(machine: Machine) -> None:
    slow: Motion = sine(1e-3, f=1.0, end=1e5)
    with begin(machine, 4, motion=slow, method="bdf", jobs=2, output_step=10.0) as runs:
        pass
    assert {one.status for one in runs} <= {"interrupted"}


def test_python_goes_on_while_runs_are_waited_for(machine: Machine) -> None:
    """Who waits holds no lock: others get many turns until the run is there, not one."""
    slow = sine(1e-3, f=1.0, end=300.0)
    waiting = threading.Thread(target=lambda: list(begin(machine, 1, motion=slow, method="bdf")))
    turns = 0
    waiting.start()
    while waiting.is_alive():
        time.sleep(1e-3)
        turns += 1
    assert turns > 10


MEMORY = """
import resource, sys
import numpy as np
from dualdrive import Machine, ensemble
from dualdrive.motion import sine

count, length, keep = int(sys.argv[1]), float(sys.argv[2]), sys.argv[3:]
gaps = {"meshes.gap": np.linspace(1e-3, 2e-3, count)}
motion = sine(1e-3, f=0.2, end=length)
for one in ensemble(Machine.load("heavy-table-250t"), motion, gaps, keep=keep, energy=False):
    assert one.status == "success", one.message
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def peak_memory(count: int, length: float, *keep: str) -> float:
    """MB, of a process of its own."""
    command = [sys.executable, "-c", MEMORY, str(count), str(length), *keep]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def test_memory_does_not_grow_with_the_number_of_runs() -> None:
    """700 more runs would be 56 MB of signals, were they kept."""
    keep = ("e", "T_1", "T_2", "theta_m", "omega_m")
    few, many = (peak_memory(count, 2.0, *keep) for count in (100, 800))
    assert many < few + 15


def test_memory_does_not_grow_with_the_length_of_runs() -> None:
    """Ten times as long: 14 MB of the three signals that figures read, were they kept."""
    short, long = (peak_memory(4, length) for length in (20.0, 220.0))
    assert long < short + 10
