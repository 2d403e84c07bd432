"""Machines turned by two motors pulling against each other on one ring gear.

The public names load on first use, so that ``import dualdrive`` and the command start at once.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from dualdrive._core import __version__

if TYPE_CHECKING:  # for editors and type checkers: what _HOMES says; a test compares the two
    from dualdrive import assembly as assembly
    from dualdrive import build as build
    from dualdrive import compare as compare
    from dualdrive import cycles as cycles
    from dualdrive import demo as demo
    from dualdrive import describe as describe
    from dualdrive import diagnose as diagnose
    from dualdrive import display as display
    from dualdrive import distributed as distributed
    from dualdrive import echo as echo
    from dualdrive import ensembles as ensembles
    from dualdrive import estimation as estimation
    from dualdrive import figures as figures
    from dualdrive import files as files
    from dualdrive import hdf5 as hdf5
    from dualdrive import identify as identify
    from dualdrive import indexing as indexing
    from dualdrive import innovations as innovations
    from dualdrive import interrupt as interrupt
    from dualdrive import linear as linear
    from dualdrive import machine as machine
    from dualdrive import machine_file as machine_file
    from dualdrive import mapper as mapper
    from dualdrive import memory as memory
    from dualdrive import motion as motion
    from dualdrive import notebook as notebook
    from dualdrive import optimise as optimise
    from dualdrive import paper as paper
    from dualdrive import plain as plain
    from dualdrive import plots as plots
    from dualdrive import readable as readable
    from dualdrive import recorder as recorder
    from dualdrive import replay as replay
    from dualdrive import report as report
    from dualdrive import run as run
    from dualdrive import said as said
    from dualdrive import simulation as simulation
    from dualdrive import store as store
    from dualdrive import sweeps as sweeps
    from dualdrive import toml_text as toml_text
    from dualdrive import traces as traces
    from dualdrive import tune as tune
    from dualdrive import units as units
    from dualdrive import web as web
    from dualdrive import workbench as workbench
    from dualdrive.ensembles import Ensemble as Ensemble
    from dualdrive.ensembles.batch import ensemble as ensemble
    from dualdrive.files import FileError as FileError
    from dualdrive.machine import Machine as Machine
    from dualdrive.machine import MachineError as MachineError
    from dualdrive.machine import presets as presets
    from dualdrive.motion import Motion as Motion
    from dualdrive.motion import default_motion as default_motion
    from dualdrive.motion import parse_motion as parse_motion
    from dualdrive.run import Run as Run
    from dualdrive.run import load_run as load_run
    from dualdrive.simulation import simulate as simulate
    from dualdrive.sweeps import Sweep as Sweep
    from dualdrive.sweeps import load_sweep as load_sweep
    from dualdrive.sweeps.sweeping import sweep as sweep

#: public name -> the module that holds it; one line per name, here and above
_HOMES: dict[str, str] = {
    "Ensemble": "dualdrive.ensembles",
    "ensemble": "dualdrive.ensembles.batch",
    "FileError": "dualdrive.files",
    "Machine": "dualdrive.machine",
    "MachineError": "dualdrive.machine",
    "presets": "dualdrive.machine",
    "Motion": "dualdrive.motion",
    "default_motion": "dualdrive.motion",
    "parse_motion": "dualdrive.motion",
    "Run": "dualdrive.run",
    "load_run": "dualdrive.run",
    "simulate": "dualdrive.simulation",
    "Sweep": "dualdrive.sweeps",
    "load_sweep": "dualdrive.sweeps",
    "sweep": "dualdrive.sweeps.sweeping",
}

#: parts that are used by their own name: dualdrive.motion.move(...)
_PARTS = (
    "assembly",
    "build",
    "compare",
    "cycles",
    "demo",
    "describe",
    "diagnose",
    "display",
    "distributed",
    "echo",
    "ensembles",
    "estimation",
    "figures",
    "files",
    "hdf5",
    "identify",
    "indexing",
    "innovations",
    "interrupt",
    "linear",
    "machine",
    "machine_file",
    "mapper",
    "memory",
    "motion",
    "notebook",
    "optimise",
    "paper",
    "plain",
    "plots",
    "readable",
    "recorder",
    "replay",
    "report",
    "run",
    "said",
    "simulation",
    "store",
    "sweeps",
    "toml_text",
    "traces",
    "tune",
    "units",
    "web",
    "workbench",
)

__all__ = ["__version__"]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
        globals()[name] = value
        return value
    if name in _PARTS:
        return import_module(f"dualdrive.{name}")
    raise AttributeError(f"module 'dualdrive' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES, *_PARTS})
