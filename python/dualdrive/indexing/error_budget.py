"""What a table's errors are made of besides its drive: the ranges of ADR 10, drawn.

One budget for all tables. The ranges were written down before the experiment ran and are held to
docs/adr/0010-tables-by-an-experiment-that-can-fail.md by a test.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.indexing.gear_grades import Gear, add_pitch_errors
from dualdrive.indexing.printed import ARCSEC
from dualdrive.machine import Machine

__all__ = ["BUDGET", "Draw", "Range", "draw", "geometry", "mechanics"]

Floats = NDArray[np.float64]


RING_RADIUS, PINION_RADIUS, MODULE = 4.0, 0.2, 0.02  # m


@dataclass(frozen=True)
class Range:
    """A contribution: from low to high, SI; log: evenly over its logarithm."""

    low: float
    high: float
    log: bool = False

    def draw(self, random: np.random.Generator) -> float:
        """One value."""
        if self.log:
            return float(np.exp(random.uniform(math.log(self.low), math.log(self.high))))
        return float(random.uniform(self.low, self.high))


#: contribution -> range, in the order in which they are drawn
BUDGET: Final[Mapping[str, Range]] = {
    "target phase": Range(0.0, math.pi / 4),
    "in-position window": Range(3.6 * ARCSEC, 7.2 * ARCSEC),
    "mesh stiffness": Range(0.7, 1.4, log=True),
    "gearbox stiffness": Range(0.7, 1.4, log=True),
    "gap of gearbox 1": Range(0.8, 1.25, log=True),
    "gap of gearbox 2": Range(0.8, 1.25, log=True),
    "gap of mesh 1": Range(0.8, 1.25, log=True),
    "gap of mesh 2": Range(0.8, 1.25, log=True),
    "friction of ring": Range(0.5, 2.0, log=True),
    "friction of pinions": Range(0.5, 2.0, log=True),
    "radial stiffness": Range(2e9, 10e9),
    "tilting stiffness": Range(2e10, 2e11),
    "ring height": Range(-0.5, 0.5),
    "scale height": Range(0.3, 1.0),
    "scale radius": Range(0.2, 0.4),
    "mesh angle": Range(0.0, 2 * math.pi),
    "mesh spacing": Range(math.pi / 2, math.pi),
    "grating": Range(0.5 * ARCSEC, 2.5 * ARCSEC),
    "grating phase": Range(0.0, 2 * math.pi),
    "heat": Range(-1.0 * ARCSEC, 1.0 * ARCSEC),
}
#: of the instrument, at every reading, rad
INSTRUMENT: Final = 0.5 * ARCSEC


@dataclass(frozen=True)
class Draw:
    """One draw of the budget: the same for every table it is given to.

    values:  contribution -> value, SI
    seed:    of what is drawn in numbers: phases of pitch errors, readings of the instrument
    """

    values: Mapping[str, float]
    seed: int

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def instrument(self, count: int) -> Floats:
        """Errors of instrument and heat at `count` readings in order, rad, shape (count,)."""
        random = np.random.default_rng((self.seed, 2))
        drift = self["heat"] * np.linspace(0.0, 1.0, count)
        return random.uniform(-INSTRUMENT, INSTRUMENT, count) + drift


def draw(number: int) -> Draw:
    """Draw number `number`: the same each time."""
    random = np.random.default_rng((number, 0))
    return Draw({name: one.draw(random) for name, one in BUDGET.items()}, number)


def mechanics(machine: Machine, drawn: Draw, *, gap: float) -> None:
    """Give a machine this draw of meshes, friction and bearing. gap: times its own."""
    core = machine.core

    def scale(path: str, factor: float) -> None:
        core.set(path, factor * core.get(path))

    closed = _end_gaps(core)
    for kind in ("mesh", "gearbox"):
        for connection in core.connections:
            if not connection.startswith(kind) or core.kind(connection) != "gap":
                continue
            number = connection.rpartition("_")[2]
            scale(f"{connection}.stiffness", drawn[f"{kind} stiffness"])
            scale(f"{connection}.gap", gap * drawn[f"gap of {kind} {number}"])
    if "split_shaft" in core.connections:  # its spring is set so that as much preload is left
        more = (_end_gaps(core) - closed) * core.get("split_shaft.stiffness")
        core.set("split_shaft.preload", core.get("split_shaft.preload") - more)
    for effect in core.effects:
        if effect["effect"] == "coulomb":
            who = "ring" if effect["place"] == "table" else "pinions"
            scale(f"{effect['label']}.torque", drawn[f"friction of {who}"])
    if _reads_the_table(machine):
        _bearing(machine, drawn)


def geometry(machine: Machine, drawn: Draw, *, grade: float) -> None:
    """Give a machine this draw's grating and the pitch errors of a grade of ISO 1328-1."""
    if _reads_the_table(machine):
        numbers = {"amplitude": drawn["grating"], "phase": drawn["grating phase"]}
        machine.add("encoder_eccentricity", "table", **numbers)
    random = np.random.default_rng((drawn.seed, 1))
    ring = Gear(RING_RADIUS, MODULE, grade)
    add_pitch_errors(machine, "table", ring, PINION_RADIUS, random, spacing=drawn["mesh spacing"])
    for pinion in ("pinion_1", "pinion_2"):
        wheel = Gear(PINION_RADIUS, MODULE, grade)
        add_pitch_errors(machine, pinion, wheel, PINION_RADIUS, random, teeth=True)


def _end_gaps(core: _core.Machine) -> float:
    """By how much the pinions of a split shaft turn against each other to close both gaps, rad."""
    return core.get("mesh_1.gap") + (core.get("mesh_2.gap") if "mesh_2" in core.connections else 0)


def _reads_the_table(machine: Machine) -> bool:
    return bool(machine.core.controller_options["position_sensor"] != "motor")


def _bearing(machine: Machine, drawn: Draw) -> None:
    """The bearing that gives under the teeth, as the table's own encoder sees it."""
    where = {
        "ring_radius": RING_RADIUS,
        "mesh_angle": drawn["mesh angle"],
        "spacing": drawn["mesh spacing"],
        "scale_radius": drawn["scale radius"],
    }
    machine.add("radial_shift", "table", compliance=1.0 / drawn["radial stiffness"], **where)
    heights = {"ring_height": drawn["ring height"], "scale_height": drawn["scale height"]}
    tilting = 1.0 / drawn["tilting stiffness"]
    machine.add("table_tilt", "table", compliance=tilting, **heights, **where)
