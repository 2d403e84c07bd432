"""Which equation fails: a known fault is put into a simulated machine and must be found there."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from dualdrive import Machine, parse_motion, simulate
from dualdrive.compare import EquationAtFault, equation_at_fault
from dualdrive.traces import Trace
from recorded import Array, demo, maker, sheet

DRIFTING = ("table.J", "motors.J", "pinions.J", "table.b", "meshes.stiffness", "meshes.gap")
RATE, END = 200.0, 14.0
#: RMS of coloured noise and step of the sensor
NOISE = {
    "theta_m": (0.03 * maker.ARCSEC, 0.01 * maker.ARCSEC),
    "theta": (3e-5, 1.2e-5),
    "I": (0.12, 0.02),
}


def nominal() -> Machine:
    return sheet(torque=6000.0)


def drifted(seed: int = 0) -> Machine:
    """What the data sheet says: every number off by some 6 %."""
    machine, random = nominal(), np.random.default_rng(seed)
    for path in DRIFTING:
        machine.set(path, machine.get(path) * float(np.exp(random.normal(0.0, 0.06))))
    return machine


def record(machine: Machine, seed: int = 0) -> Trace:
    """Four moves, with coloured noise, rounding, and encoders whose zeros differ."""
    motion = parse_motion("cycle:0;0.02;0.005;0.01;0,v=0.02,a=0.012,j=0.05,dwell=0.8,start=1.5")
    run, random = simulate(machine, motion, end=END), np.random.default_rng(seed)
    t = np.arange(0.0, END, 1.0 / RATE)
    pole = float(np.exp(-2 * np.pi * 25.0 / RATE))

    def seen(name: str, kind: str) -> Array:
        rms, step = NOISE[kind]
        white = random.normal(0.0, rms * np.sqrt(1.0 - pole**2), len(t))
        noisy = np.interp(t, run.t, run[name]) + lfilter([1.0], [1.0, -pole], white)
        rounded: Array = step * np.round(noisy / step)
        return rounded

    channels = {"theta_ref": np.interp(t, run.t, run["theta_ref"])}
    channels["theta_m"] = seen("theta_m", "theta_m")
    for n, zero in ((1, 0.3), (2, -0.1)):
        channels[f"theta_{n}"] = seen(f"theta_{n}", "theta") + zero
        channels[f"I_{n}"] = seen(f"I_{n}", "I")
    return Trace(t, channels, name="record")


@functools.cache
def found(name: str) -> EquationAtFault | None:
    machine = nominal()
    FAULTS[name](machine)
    return equation_at_fault(drifted(), record(machine))


FAULTS: dict[str, Callable[[Machine], object]] = {
    "none": lambda m: None,
    "motor_1": lambda m: m.add("coulomb", "motor_1", torque=4.0),
    "motor_2": lambda m: m.add("cogging", "motor_2", amplitude=4.0, order=8),
    "motors": lambda m: m.add("coulomb", "motors", torque=4.0),
    "mesh_1": lambda m: m.add("eccentricity", "pinion_1", amplitude=5e-4),
}


@pytest.mark.parametrize("name", [n for n in FAULTS if n != "none"])
def test_the_equation_with_the_fault_is_named(name: str) -> None:
    fault = found(name)
    assert fault is not None
    assert fault.name == name, fault
    assert fault.probability > 0.9
    assert 0.6 < fault.shares[name] <= 1.0


def test_drifted_numbers_alone_are_no_fault() -> None:
    assert found("none") is None


@pytest.mark.parametrize("name", ["fit", "held_out"])
def test_the_demo_lacks_something_at_the_table(name: str) -> None:
    """Its records come from the independent reference model with dry friction of 12 kN m there."""
    fault = equation_at_fault(sheet(), demo(name))
    assert fault is not None
    assert (fault.name, fault.probability > 0.95) == ("table", True)
    assert equation_at_fault(sheet(torque=12000.0), demo(name)) is None


def test_without_motor_angles_the_sum_alone_can_be_told() -> None:
    trace = demo("fit").without("theta_1", "theta_2")
    fault = equation_at_fault(sheet(), trace)
    assert fault == EquationAtFault("total", 1.0, {"total": 1.0})
