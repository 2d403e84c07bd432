"""Machines of the blind generator's first part that a search had lost its way on."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from dualdrive import Machine
from dualdrive.diagnose import diagnose
from dualdrive.traces import read

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from tests.blind import generate


@pytest.mark.long
def test_the_damping_of_a_mesh_that_bounces_is_named(tmp_path: Path) -> None:
    """Without tension two motors hunt: torque of unknown course had stood in for the damping."""
    generate.main(["--part", "develop", "--from", "43", "--cases", "1", "-o", str(tmp_path)])
    [folder] = (tmp_path / "cases").iterdir()
    case = json.loads((folder / "case.json").read_text())
    found = diagnose(
        Machine.load(folder / case["machine"]),
        {name: read(folder / name) for name in case["records"]},
        settings=case["settings"],
        experiment=False,
    )
    assert found.verdict == "effect"
    assert found.candidates[0].label == "mesh_damping@meshes"
    size = found.candidates[0].parameters["mesh_damping@meshes.coefficient"].value
    assert size == pytest.approx(0.04249, rel=0.01)
