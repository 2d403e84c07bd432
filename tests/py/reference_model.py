"""The whole machine once more, in plain Python: the oracle the product is tested against.

Plant, master/slave controller and commanded motion together are affine as long as no flank opens or
closes, nothing starts to stick or slip and no limit is reached: ż = A(mode) z, the last state being
the constant 1. Each mode is solved exactly with the matrix exponential; the end of a mode is a root
of a guard, searched on that exact solution. Nothing is integrated numerically.

Quantities are SI. Angles, speeds and torques of a pinion are pinion-side, T_motor is motor-side.
The pinion angles are carried as twists x_n = θ_cn − i_m θ_m of their meshes, so that rounding of an
absolute angle never reaches a contact torque.

Here are the runs; machines, motions, equations and the solution of a mode have a file each beside
this one: reference_machine.py, _motion.py, _equations.py and _solution.py.

Equation numbers are those of the source paper, with its misprints corrected (docs/theory).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_equations import (
    COMMAND,
    FLANK,
    PLANT,
    Array,
    Assembly,
    Guard,
    Modes,
    first_modes,
)
from reference_machine import Controller, Drive, Machine, bench, heavy_table, speed_study
from reference_motion import Motion, load_ramp, move, sine, step
from reference_solution import Mode

__all__ = [
    "COMMAND",
    "PLANT",
    "Array",
    "Controller",
    "Drive",
    "Event",
    "Machine",
    "Motion",
    "Simulation",
    "Trajectory",
    "bench",
    "first_modes",
    "heavy_table",
    "load_ramp",
    "move",
    "simulate",
    "sine",
    "speed_study",
    "step",
]


class Event(NamedTuple):
    """A change of one switching element; for a mesh the modes are its flanks −1, 0, +1."""

    t: float
    element: str
    before: str
    after: str


@dataclass
class Trajectory:
    """States on a regular grid, shape (times, states), with the events between."""

    t: Array
    z: Array
    modes: list[Mode] = field(repr=False)
    events: list[Event] = field(repr=False)

    def __getitem__(self, name: str) -> Array:
        """Return a state or an output, shape (times,)."""
        assembly = self.modes[0].assembly
        if name in assembly.state:
            return np.array(self.z[:, assembly.names.index(name)])
        rows = np.array([mode.assembly.outputs[name] for mode in self.modes])
        return np.array(np.einsum("ij,ij->i", rows, self.z))

    @property
    def X(self) -> Array:
        """The state vector in the order of Eq. 23, shape (times, 8)."""
        return np.column_stack([self[name.replace("x_", "theta_c")] for name in PLANT])

    @property
    def contacts(self) -> list[tuple[float, int, int, int]]:
        """(time, mesh, flank before, flank after) of every contact made or lost."""
        changes = [
            (event.t, int(event.element[-1]), FLANK.get(event.before, 0), FLANK.get(event.after, 0))
            for event in self.events
            if event.element.startswith("mesh")
        ]
        return [change for change in changes if change[2] != change[3]]

    def flanks(self) -> NDArray[np.int_]:
        """Return the flank each mesh stands on, shape (times, 2)."""
        modes = [mode.assembly.modes for mode in self.modes]
        meshes = ("mesh_1", "mesh_2")
        return np.array([[FLANK.get(mode.get(mesh, ""), 0) for mesh in meshes] for mode in modes])


class ChatteringError(RuntimeError):
    """The elements of the machine switch for ever at one instant."""


class Simulation:
    """The modes of one machine under one motion, made when they are first met."""

    def __init__(self, machine: Machine, motion: Motion, grid: float) -> None:
        frequencies = tuple(frequency for _, frequency, _ in motion.sines)

        @cache
        def mode(items: tuple[tuple[str, str], ...]) -> Mode:
            return Mode(Assembly(machine, frequencies, dict(items)), grid)

        self._mode, self.motion, self.grid, self.machine = mode, motion, grid, machine
        self.events: list[Event] = []

    def mode(self, modes: Modes) -> Mode:
        return self._mode(tuple(modes.items()))

    def switch(self, t: float, mode: Mode, guard: Guard, z: Array) -> Mode:
        """Return the mode after a crossing: the first successor whose own guards hold."""
        before = mode.assembly.modes
        for successor in guard.successors:
            after = self.mode(before | {guard.element: successor})
            own = [other.element == guard.element for other in after.guards]
            if np.all(after.signs(z)[own] >= 0):
                break
        self.events.append(Event(t, guard.element, before[guard.element], successor))
        return after

    def settle(self, t: float, mode: Mode, z: Array) -> Mode:
        """Switch at one instant, after a jump of the command or load, until every guard holds."""
        for _ in range(100):
            signs = mode.signs(z)
            if np.all(signs >= 0):
                return mode
            mode = self.switch(t, mode, mode.guards[int(np.argmin(signs))], z)
        raise ChatteringError(f"the machine finds no consistent mode at t = {t:.6g} s")

    def start(self, start: Mapping[str, float]) -> tuple[Mode, Array]:
        mode = self.mode(first_modes(self.machine, start))
        values = dict.fromkeys(mode.assembly.names, 0.0) | {"one": 1.0} | dict(start)
        for k, (amplitude, _, phase) in enumerate(self.motion.sines):
            values[f"sine_{k}"] = amplitude * np.sin(phase)
            values[f"cosine_{k}"] = amplitude * np.cos(phase)
        z = np.array([values[name] for name in mode.assembly.names])
        mode = self.settle(0.0, mode, z)
        self.events.clear()
        return mode, z

    def spans(self, steps: int) -> Iterator[tuple[int, float, float, Mapping[str, float]]]:
        """Yield (grid step, offset in it, span up to the next stop, states set anew first)."""
        points = list(self.motion.breakpoints)
        for k in range(steps):
            offset = 0.0
            fresh: Mapping[str, float] = {}
            while points and (at := points[0][0] - k * self.grid) < self.grid * (1 - 1e-9):
                if at > offset + 1e-12:
                    yield k, offset, at - offset, fresh
                    offset, fresh = at, {}
                fresh = {**fresh, **points.pop(0)[1]}
            yield k, offset, self.grid - offset if offset else self.grid, fresh

    def run(self, steps: int, start: Mapping[str, float]) -> Trajectory:
        mode, z = self.start(start)
        names = mode.assembly.names
        states, modes = np.empty((steps + 1, len(z))), []
        for k, offset, span, fresh in self.spans(steps):
            if fresh:
                z[[names.index(name) for name in fresh]] = list(fresh.values())
                mode = self.settle(k * self.grid + offset, mode, z)
            if not offset:
                states[k] = z
                modes.append(mode)
            switches = 0
            while span > 0:
                passed, guard, z = mode.advance(z, span)
                span, offset = span - passed, offset + passed
                if guard is None:
                    break
                if guard.vanishing is not None:
                    z[guard.vanishing] = 0.0
                mode = self.switch(k * self.grid + offset, mode, guard, z)
                switches += 1
                if switches > 1000:
                    raise ChatteringError(f"{guard.element} chatters at t = {k * self.grid:.6g} s")
        states[-1] = z
        t = np.arange(steps + 1, dtype=np.float64) * self.grid
        return Trajectory(t, states, [*modes, mode], self.events)


def simulate(
    machine: Machine,
    motion: Motion,
    duration: float,
    grid: float = 1e-3,
    start: Mapping[str, float] | None = None,
    perturbation: float = 0.0,
) -> Trajectory:
    """Run the machine from rest, pinions mid-gap unless `start` sets states otherwise.

    `perturbation` shifts the first twist by that share of the half gap: two runs that differ by
    1e-12 there show how far the chaos of impacts lets any two solvers agree.
    """
    start = dict(start or {})
    start["x_1"] = start.get("x_1", 0.0) + perturbation * machine.drives[0].gap
    return Simulation(machine, motion, grid).run(round(duration / grid), start)
