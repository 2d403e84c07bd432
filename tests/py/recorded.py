"""Traces for tests of compare and fit: demo records, and clean ones of the reference model."""

from __future__ import annotations

import functools
import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import Machine
from dualdrive.traces import Trace, read

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "python" / "dualdrive" / "demo"
sys.path.insert(0, str(ROOT / "tools"))
maker = importlib.import_module("make_demo_trace")

Array = NDArray[np.float64]

#: gtau N/V and the rig's gains, from the SOURCE.md beside its record
EMPS = {"gtau": 35.15065188248547, "k_p": 160.18, "k_v": 243.45}


def sheet(**friction: float) -> Machine:
    """The demo's machine by its data sheet, with Coulomb friction at the table if asked for."""
    machine = Machine.load(DEMO / "machine.toml")
    if friction:
        machine.add("coulomb", "table", **friction)
    return machine


def demo(name: str) -> Trace:
    """A record of the demo."""
    return read(DEMO / f"{name}.csv")


@functools.cache
def clean(friction: float = 12000.0, record: str = "fit") -> Trace:
    """What the reference model says the data sheet's machine with that friction would record."""
    machine = maker.build(maker.nominal(), friction)
    return _trace(machine, maker.run(machine, record))


@functools.cache
def long_move() -> Trace:
    """The same of one move that runs at its full 0.015 rad/s from about 3 s to 5.4 s."""
    machine = maker.build(maker.nominal(), 12000.0)
    motion = maker.move(0.06, 0.015, 0.012, 0.05, 1.5)
    return _trace(machine, maker.simulate(machine, motion, 8.0, grid=maker.SAMPLE))


def _trace(machine: Any, run: Any) -> Trace:
    channels = maker.signals(machine, run)
    channels["theta_m"] = channels["theta_m"] * maker.ARCSEC
    return Trace(channels.pop("t"), channels, name="clean")


def emps_rig(friction: float | None) -> Machine:
    """The linear axis with its own sampled controller, at the published values."""
    machine = Machine.load("linear-axis")
    machine.remove("coulomb@table")
    settings = {
        "table.J": 95.109,
        "table.b": 203.50,
        "motor_1.T_max": 10.0 * EMPS["gtau"],
        "motor_1.omega_max": 1.0,
        "controller.K_v": EMPS["k_p"],
        "controller.k_p": EMPS["gtau"] * EMPS["k_v"],
    }
    for path, value in settings.items():
        machine.set(path, value)
    if friction is not None:
        machine.add("coulomb", "table", torque=friction)
    return machine


def small_axis(**effects: float) -> Machine:
    """A light single axis, continuous loop: simulates in milliseconds."""
    machine = Machine.load("linear-axis")
    for path in ("controller.position_sample", "controller.speed_sample"):
        machine.set(path, 0.0)
    machine.core.set_controller(speed_samples=0)
    machine.set("coulomb@table.torque", effects.get("coulomb", 20.0))
    return machine


def relative(residual: Any, measured: Any) -> float:
    """RMS over RMS about the mean."""
    return float(np.sqrt(np.mean(np.square(residual))) / np.std(measured))
