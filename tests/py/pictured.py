"""Runs and a comparison for tests of pictures, and what was drawn of them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare import Comparison, Condition, NoiseFloor, Quantity
from dualdrive.machine import Machine
from dualdrive.motion import parse_motion
from dualdrive.run import Run
from dualdrive.simulation import simulate
from dualdrive.traces import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
ARCSEC = np.pi / 648000


@cache
def swing() -> Run:
    """The 100 t table to 10 mrad and back."""
    motion = parse_motion("cycle:0.01;0,v=0.02,a=0.01,j=0.05,dwell=0.5,start=2")
    return simulate(Machine.load("heavy-table-100t"), motion)


@cache
def hunting() -> Run:
    """550 t without tension: the play never comes to rest."""
    machine = Machine.load("heavy-table-550t")
    machine.set("controller.T_ten", 0.0)
    return simulate(machine, parse_motion("move:0.02,v=0.03,a=0.01,j=0.05,start=2"), end=12.0)


@cache
def linear() -> Run:
    return simulate(Machine.load("linear-axis"))


def trace_of(run: Run, *channels: str) -> Trace:
    """The channels as a recorder would have them."""
    return Trace(run.t, {name: run[name] for name in channels})


@cache
def comparison() -> Comparison:
    """Two records; the model of the error is a quarter too small, and nothing else is wrong."""
    t = np.linspace(0.0, 10.0, 2001)
    error, current = 40 * ARCSEC * np.sin(2 * np.pi * t), 5.0 + np.cos(t)

    def quantity(record: str, name: str, kind: str, unit: str, x: Array, share: float) -> Quantity:
        noise, counted = NoiseFloor(0.02 * float(np.std(x)), "stated"), np.ones(len(t), dtype=bool)
        return Quantity(record, name, kind, unit, kind, True, t, x, share * x, counted, 0.0, noise)

    quantities = [
        quantity(record, *what)
        for record in ("first", "second")
        for what in (
            ("e", "following error", "rad", error, 0.75),
            ("I_1", "current", "A", current, 1.0),
        )
    ]
    where = [Condition("motion", "reversal", 2.5, 0.1, 0.6), Condition("time", "0 .. 1 s", 9, 1, 1)]
    return Comparison("bench", "closed_loop", quantities, where, {}, {}, [])


def drawn(axes: Axes, label: str) -> tuple[Array, Array]:
    """The data of the line with this label."""
    (found,) = [line for line in axes.lines if line.get_label() == label]
    x, y = found.get_data()
    return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)


def vertices(path: Any) -> Array:
    return np.asarray(path.vertices, dtype=np.float64)
