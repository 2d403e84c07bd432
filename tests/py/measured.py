"""Measured records of real machines, read where they lie; a test skips where they are absent."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from balance_stand_in import Recorded

ROOT = Path(__file__).resolve().parents[2]


def measured_file(name: str) -> Path:
    """A file below the folder of measured data."""
    folder = Path(os.environ.get("DUALDRIVE_DATA", ROOT.parent / "shared" / "data"))
    if not (folder / name).exists():
        pytest.skip(f"measured data is not here: {folder / name} (DUALDRIVE_DATA names its folder)")
    return folder / name


def emps() -> Recorded:
    """Position in m as theta_m, force in N as T_1."""
    from scipy.io import loadmat

    raw = loadmat(measured_file("emps/DATA_EMPS.mat"))
    force = raw["vir"].ravel() * float(raw["gtau"].squeeze())
    return Recorded(raw["t"].ravel(), {"theta_m": raw["qm"].ravel(), "T_1": force})


def rig(log: str, *, split_tension: bool) -> dict[str, Recorded]:
    """Tests of the dual-motor rig in rad and N*m, all signs those of the positions.

    The recorded torques count against the positions, and drive 2 is mounted mirrored; the brake
    takes its torque from whichever way the ring turns.
    """
    import pandas as pd

    table = pd.read_csv(measured_file(f"dual_motor_rig/{log}.csv"))
    stamps = pd.to_datetime(table["Timestamp"])
    table["t"] = (stamps - stamps.iloc[0]).dt.total_seconds()
    table = table[(table["TestIndex"] > 0) & (table["Running"] > 0)]
    tension = table["AntiBacklashEnabled"].to_numpy(int) if split_tension else 0
    label = [
        f"test {i}, tension {k}" if split_tension else f"test {i}"
        for i, k in np.broadcast(table["TestIndex"].to_numpy(int), tension)
    ]
    found = {}
    for name, part in table.groupby(label):
        t = part["t"].to_numpy()
        ring = np.radians(part["ENC1Position"].to_numpy(float))
        speed = np.gradient(np.convolve(ring, np.ones(21) / 21, "same"), t)
        brake = np.abs(part["FC3Torque"].to_numpy(float)) * np.tanh(speed / 0.1)
        found[str(name)] = Recorded(
            t,
            {
                "theta_m": ring,
                "theta_1": np.radians(part["FC1Position"].to_numpy(float)),
                "theta_2": np.radians(part["FC2Position"].to_numpy(float)),
                "T_1": -part["FC1Torque"].to_numpy(float),
                "T_2": part["FC2Torque"].to_numpy(float),
                "brake": brake,
            },
        )
    return found
