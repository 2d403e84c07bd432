"""The good files that attempts begin with: small, and made by the tool itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import savemat

from dualdrive import Machine
from dualdrive.motion import parse_motion
from dualdrive.simulation import simulate
from dualdrive.traces import read

MAPPING = """\
[file]
delimiter = ","
[time]
column = "t"
unit = "s"
[columns."theta_m"]
unit = "rad"
[columns."T_1"]
unit = "N*m"
scale = 1.0
"""
DRIVES = "37264 = 20\n"
PULLS = """\
shafts = ["theta_1"]
hold = { theta_ref = 0.0 }
[[pulls]]
command = "theta_m"
position = "theta_1"
pulled = 1
rest = 0
reached = 1
at_rest = 1
"""


def make_inputs(folder: Path) -> None:
    """A machine, records of it in every format, a mapping, a run, a drive's parameters."""
    machine = Machine.load("bench")
    machine.save(folder / "machine.toml")
    words = "shuttle:0.2,speeds=0.3;0.6,a=2,dwell=0.5,start=0.5,end=7"
    run = simulate(machine, parse_motion(words), output_step=5e-3)
    run.save(folder / "run.h5")
    names = [
        name for name in ("theta_ref", "theta_m", "theta_1", "theta_2", "T_1", "T_2") if name in run
    ]
    run.to_pandas()[names].to_csv(folder / "record.csv")
    columns = {"t": run.t, **{name: np.array(run[name]) for name in names}}
    savemat(folder / "record.mat", columns)
    savemat(folder / "packed.mat", {"run": columns}, do_compression=True)
    read(folder / "record.csv").to_hdf5(folder / "trace.h5")
    (folder / "mapping.toml").write_text(MAPPING)
    (folder / "drives.toml").write_text(DRIVES)
    (folder / "pulls.toml").write_text(PULLS)
