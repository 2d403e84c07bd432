"""Files of sweeps that are there already, are of another sweep, or never come to be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from dualdrive.files import FileError
from dualdrive.machine import Machine
from dualdrive.motion import Motion, sampled
from dualdrive.simulation import simulate
from dualdrive.sweeps import GridError, load_sweep, resume, sweep
from small_sweep import AXES, MOTION, swept_file, table


@pytest.fixture(scope="module")
def machine() -> Machine:
    return table()


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept_file(tmp_path_factory.mktemp("sweep"))


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
