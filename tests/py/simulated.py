"""Records of a simulated heavy table, as a drive's trace has them: noisy, rounded, zeros apart."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from dualdrive import Machine, parse_motion, simulate
from dualdrive.traces import Trace
from recorded import Array, maker, sheet

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


def with_changed(trace: Trace, **channels: Array) -> Trace:
    """The same with other channels."""
    return Trace(trace.t, {**{c: trace[c] for c in trace}, **channels}, name=trace.name)
