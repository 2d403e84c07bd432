"""Ensembles: one machine run many times with other numbers, motions or loads, on all cores.

import dualdrive, numpy

machine = dualdrive.Machine.load()
gaps = numpy.random.default_rng(1).normal(8e-4, 1e-4, 1000)
runs = dualdrive.ensemble(machine, values={"meshes.gap": gaps})
for run in runs:
    print(run.run, run.status, run.figures["peak_error"])
runs.dataset()["peak_error"].plot()
"""

from .batch import ensemble
from .runs import PENDING, SPEED, Ensemble, Outcome, cores

__all__ = ["PENDING", "SPEED", "Ensemble", "Outcome", "cores", "ensemble"]
