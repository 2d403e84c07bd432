"""Which recorded channels a simulated loop is held against, and how.

Absolute angles fit whatever is missing, because the position loop makes them; what tells is the
following error, the currents or torques, and the deflection between motor and table. Those three
make the headline error, the rest is compared and shown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.traces import CHANNELS, Trace

Array = NDArray[np.float64]

#: kinds that the headline error averages
HEADLINE = ("following error", "current", "torque", "deflection")

_KINDS = {
    "theta": "angle",
    "omega": "speed",
    "I": "current",
    "T": "torque",
    "U": "voltage",
}
#: what goes into a simulation, not out of it
INPUTS = ("theta_ref", "omega_ref", "T_load")


@dataclass(frozen=True, eq=False)
class Compared:
    """One quantity that trace and simulation both have.

    measured:   recorded values in SI, shape (n,)
    parts:      (recorded channel, factor): the simulated value is their sum, and so is `measured`
    floating:   its zero is not known (two encoders have no common zero)
    """

    name: str
    kind: str
    unit: str
    long_name: str
    measured: Array
    parts: tuple[tuple[str, float], ...]
    floating: bool = False

    @property
    def headline(self) -> bool:
        """Whether the headline error counts it."""
        return self.kind in HEADLINE

    @property
    def spread(self) -> float:
        """RMS of the measured values about their mean: what an error is relative to."""
        return float(np.std(self.measured))


def compared_channels(core: Any, trace: Trace, reference: Array | None) -> list[Compared]:
    """Everything in a trace that this machine simulates, derived channels first.

    reference: the commanded table angle at the trace's times, None where it is not known
    """
    signals = {name: (unit, text) for name, unit, text in core.signals()}
    found: list[Compared] = []
    if reference is not None and "theta_m" in trace:
        measured = reference - trace["theta_m"]
        parts = (("theta_ref", 1.0), ("theta_m", -1.0))
        text = "following error, commanded minus table angle"
        found.append(Compared("e", "following error", "rad", text, measured, parts))
    found += deflections(core, trace)
    for name in trace:
        if name in signals and name in CHANNELS and name not in INPUTS:
            kind = _KINDS[name.partition("_")[0]]
            unit, text = signals[name]
            floating = kind == "angle" and name != "theta_m"
            own = ((name, 1.0),)
            found.append(Compared(name, kind, unit, text, trace[name], own, floating))
    return [c for c in _once(found) if c.spread > 0]


def deflections(core: Any, trace: Trace | Mapping[str, Array]) -> list[Compared]:
    """Twist between motor (or pinion) encoder and table encoder, in the pinion's frame."""
    found: list[Compared] = []
    for motor in core.motors if "theta_m" in trace else ():
        n = motor.rpartition("_")[2]
        gearbox, mesh = f"gearbox_{n}", f"mesh_{n}"
        if mesh not in core.connections:
            continue
        geared = gearbox in core.connections
        ends = (
            (f"theta_{n}", core.get(f"{gearbox}.ratio") if geared else 1.0, f"x_{n}"),
            (f"theta_c{n}", 1.0, f"x_c{n}"),
        )
        for angle, ratio, name in ends:
            chain = [gearbox, mesh] if geared and angle == f"theta_{n}" else [mesh]
            if angle not in trace or all(core.kind(c) == "rigid" for c in chain):
                continue
            down = core.get(f"{mesh}.ratio")
            parts = ((angle, 1.0 / ratio), ("theta_m", -down))
            measured = trace[angle] / ratio - down * trace["theta_m"]
            text = f"deflection of drive {n} at the pinion, {angle} / {ratio:g} - {down:g} theta_m"
            found.append(Compared(name, "deflection", "rad", text, measured, parts, True))
    return found


def ratio_to_table(core: Any, part: str) -> float:
    """Speed of a part over that of the table: 1 for the table, i_m at a pinion or mesh."""
    stem, _, n = part.rpartition("_")
    chain = {
        "motor": ("gearbox", "mesh"),
        "gearbox": ("mesh",),
        "pinion": ("mesh",),
        "mesh": ("mesh",),
    }
    ratio = 1.0
    for link in chain.get(stem, ()):
        if f"{link}_{n}" in core.connections:
            ratio *= core.get(f"{link}_{n}.ratio")
    return ratio


def _once(found: Sequence[Compared]) -> list[Compared]:
    """Current and torque of a motor tell the same: where both are recorded, the current counts."""
    names = {c.name for c in found}
    return [
        Compared(c.name, "recorded torque", c.unit, c.long_name, c.measured, c.parts)
        if c.kind == "torque" and c.name.replace("T_", "I_") in names
        else c
        for c in found
    ]
