"""Measured records of real machines, read where they lie; a test skips where they are absent."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dualdrive.traces import Trace, read, read_parts

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
BESIDE = Path(__file__).resolve().parents[3] / "shared" / "data"


def measured_file(name: str) -> Path:
    """A file below the folder of measured data."""
    path = Path(os.environ.get("DUALDRIVE_DATA", BESIDE)) / name
    if not path.exists():
        pytest.skip(f"measured data is not here: {path} (DUALDRIVE_DATA names its folder)")
    return path


def emps() -> Trace:
    """The linear axis: position in m as theta_m, force in N as T_1."""
    return read(measured_file("emps/DATA_EMPS.mat"), EXAMPLES / "emps.map.toml")


def rig(log: str) -> dict[str, Trace]:
    """Tests of the dual-motor rig, split by TestIndex and by tension off (0) and on (1)."""
    mapping = EXAMPLES / "dual_motor_rig.map.toml"
    parts = read_parts(measured_file(f"dual_motor_rig/{log}.csv"), mapping)
    return {_label(part, k): part for k, part in enumerate(parts)}


def _label(part: Trace, number: int) -> str:
    test, tension = (int(part.labels[n]) for n in ("TestIndex", "AntiBacklashEnabled"))
    return f"test {test}, tension {tension}, part {number}"
