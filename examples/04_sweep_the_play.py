"""How the standstill amplitude grows with the play, over all cores, into a labelled grid."""

import tempfile
from pathlib import Path

import numpy as np

import dualdrive

machine = dualdrive.Machine.load("heavy-table-250t")
machine.set("controller.T_ten", 0)
motion = dualdrive.motion.move(0.02, v=0.03, a=0.01, j=0.05, start=2.0, end=14.0)
with tempfile.TemporaryDirectory() as folder:
    sweep = dualdrive.sweep(
        machine,
        {"meshes.gap": np.linspace(0.5e-3, 2e-3, 4)},
        motion=motion,
        output=Path(folder) / "sweep.h5",
    )
    print(sweep.dataset["standstill_amplitude"].to_series())
