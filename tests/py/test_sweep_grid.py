"""The grid of a sweep: values of its axes, the numbers of its runs, and what makes no sense."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dualdrive.machine import Machine
from dualdrive.sweeps import GridError, lay_out
from small_sweep import AXES, table


@pytest.fixture(scope="module")
def machine() -> Machine:
    return table()


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
