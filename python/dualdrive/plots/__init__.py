"""Pictures an engineer looks at: each function returns a matplotlib `Figure`, drawn off screen.

They take what the rest of dualdrive returns (a `Run`, a `Trace`, a comparison, an estimate) and, if
given, axes to draw in. Units are those people read: arc seconds, mrad, N·m, ms.

    from dualdrive import Machine, simulate
    from dualdrive.plots import overview

    overview(simulate(Machine.load())).savefig("run.png")
"""

from dualdrive.plots.bode_plot import bode, drives
from dualdrive.plots.comparison import conditions, measured_vs_model, residuals
from dualdrive.plots.cycles import cycle, cycle_branch, cycle_map
from dualdrive.plots.diagnosis import (
    candidates,
    diagnosed,
    equations,
    experiments,
    missing_torque,
    planned_motion,
)
from dualdrive.plots.friction import torque_speed
from dualdrive.plots.front import pareto
from dualdrive.plots.indexing_plot import indexing
from dualdrive.plots.ladder_plot import Step, ladder
from dualdrive.plots.mapping_plot import mapping
from dualdrive.plots.overview_plot import overview
from dualdrive.plots.play_plot import play
from dualdrive.plots.record import PlotError
from dualdrive.plots.reversal import reversal_window, reversal_zoom
from dualdrive.plots.timeline import following_error, mesh_deflection, torques
from dualdrive.plots.tuning_plot import tuning, tuning_step

__all__ = [
    "PlotError",
    "Step",
    "bode",
    "candidates",
    "conditions",
    "cycle",
    "cycle_branch",
    "cycle_map",
    "diagnosed",
    "drives",
    "equations",
    "experiments",
    "following_error",
    "indexing",
    "ladder",
    "mapping",
    "measured_vs_model",
    "mesh_deflection",
    "missing_torque",
    "overview",
    "pareto",
    "planned_motion",
    "play",
    "residuals",
    "reversal_window",
    "reversal_zoom",
    "torque_speed",
    "torques",
    "tuning",
    "tuning_step",
]
