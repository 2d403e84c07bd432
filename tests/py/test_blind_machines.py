"""Machines of the blind generator's first part that a search had lost its way on."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from dualdrive import Machine
from dualdrive.diagnose import Diagnosis, diagnose
from dualdrive.traces import read

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from tests.blind import generate


def diagnosed(number: int, folder_of_all: Path) -> Diagnosis:
    """What is said of a machine of the part to develop on."""
    where = ["--part", "develop", "--from", str(number), "--cases", "1", "-o", str(folder_of_all)]
    generate.main(where)
    [folder] = (folder_of_all / "cases").iterdir()
    case = json.loads((folder / "case.json").read_text())
    return diagnose(
        Machine.load(folder / case["machine"]),
        {name: read(folder / name) for name in case["records"]},
        settings=case.get("settings"),
        experiment=False,
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "label", "path", "value", "within"),
    [
        (43, "mesh_damping@meshes", "coefficient", 0.04249, 0.01),
        (56, "transport_delay@controller", "delta_c", 2.16e-4, 0.25),
    ],
    ids=["a mesh that bounces", "a command that is less than a sample late"],
)
def test_the_law_is_named(
    tmp_path: Path, number: int, label: str, path: str, value: float, within: float
) -> None:
    """Torque of unknown course had stood in for the damping, a late encoder for the command.

    Within two ticks of its loop, 0.125 ms each, a late command does one and the same.
    """
    found = diagnosed(number, tmp_path)
    assert found.verdict == "effect"
    best = found.candidates[0]
    assert best.label == label
    assert best.parameters[f"{label}.{path}"].value == pytest.approx(value, rel=within)


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "why"),
    [
        (130, "motor_1.K_d does not stay"),
        (156, "asks for a torque of unknown course, however small"),
    ],
    ids=["a current whose gain drifts", "a motor that hums"],
)
def test_what_no_law_describes_is_not_called_adequate(
    tmp_path: Path, number: int, why: str
) -> None:
    """Zeros that may drift, or a torque of a hundred thousandth, had made it white."""
    found = diagnosed(number, tmp_path)
    assert found.verdict == "unknown"
    assert any(why in warning for warning in found.warnings)
