"""The heavy table at its loads, with other numbers or tuned."""

from __future__ import annotations

from functools import cache

from dualdrive.machine import Machine
from dualdrive.motion import parse_motion
from dualdrive.tune import Tuning, tune

#: of the study that set the heavy table's numbers
STUDY = "move:0.02,v=0.03,a=0.01,j=0.05,start=2,end=14"


def heavy(load: str = "550t", **changes: float) -> Machine:
    """The preset; in the name of a change two underscores stand for the dot of its path."""
    machine = Machine.load(f"heavy-table-{load}")
    for path, value in changes.items():
        machine.set(path.replace("__", "."), value)
    return machine


@cache
def tuned(load: str) -> Tuning:
    """Without tension to begin with."""
    return tune(heavy(load, controller__T_ten=0.0), parse_motion(STUDY))
