"""What a sweep computes: one machine, one motion, a grid; and whether a file is about the same."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np

from dualdrive import __version__, _core, units
from dualdrive.build import core_digest
from dualdrive.ensembles import SPEED, Ensemble, ensemble
from dualdrive.figures import Figure, declared, is_controlled
from dualdrive.machine import Machine

from .grid import Grid, GridError
from .layout import Kept

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dualdrive.motion import Motion

__all__ = ["Plan", "machine_differences"]


@dataclass(frozen=True)
class Plan:
    """One sweep, checked. load in N·m, times in s; keep: signals to store whole."""

    machine: Machine
    motion: Motion
    grid: Grid
    load: float
    end: float
    output_step: float
    rtol: float
    method: str
    max_steps: int | None = None
    keep: tuple[str, ...] = ()
    engine: str = "auto"
    energy: bool = True

    def __post_init__(self) -> None:
        if not is_controlled(self.machine):
            raise GridError(
                f"{self.machine.name}: has no controller, so that it follows no motion; give it one"
            )
        known = [name for name, _, _ in self.machine.core.signals()]
        for name in self.keep:
            if name not in known:
                ways = " or ".join(get_close_matches(name, known)) or ", ".join(known)
                raise GridError(f"keep = {name!r}: no such signal of this machine; take {ways}")
        try:
            _core.Scenario({}, end=self.end, engine=self.engine, method=self.method)
        except ValueError as error:
            raise GridError(str(error)) from None
        if not 1e-14 <= self.rtol <= 1e-2:
            raise GridError(f"rtol = {self.rtol}: must lie between 1e-14 and 1e-2")
        if self.max_steps is not None and self.max_steps < 1:
            raise GridError(f"max_steps = {self.max_steps}: must be at least 1, or left out")
        if not math.isfinite(self.load):
            raise GridError(f"load = {self.load}: must be finite")
        if not (math.isfinite(self.end) and self.end > 0):
            raise GridError(f"end = {self.end}: must be a time in s after 0")
        if not (math.isfinite(self.output_step) and 0 < self.output_step <= self.end):
            raise GridError(f"output_step = {self.output_step}: must be above 0, at most the end")

    @property
    def figures(self) -> tuple[Figure, ...]:
        """Every figure of a run, the measured speed last."""
        return (*declared(self.machine), SPEED)

    @property
    def times(self) -> NDArray[np.float64]:
        """Output times in s, from 0 to the end, shape (n,)."""
        count = max(1, round(self.end / self.output_step))
        return np.linspace(0.0, self.end, count + 1)

    @property
    def kept(self) -> Kept | None:
        """Description of the signals kept whole; None when there are none."""
        if not self.keep:
            return None
        known = {name: (unit, text) for name, unit, text in self.machine.core.signals()}
        described = [
            (name, self.machine.unit_of(name, known[name][0]), known[name][1]) for name in self.keep
        ]
        return Kept(self.times, described)

    def attributes(self, command: str) -> dict[str, Any]:
        """What the file says about where its numbers come from."""
        return {
            "version": __version__,
            "core": core_digest(),
            "machine": self.machine.toml(),
            "machine_name": self.machine.name,
            "motion": self.motion.text,
            "motion_digest": _digest(self.motion, self.times),
            "command": command,
            "axes": json.dumps([axis.path for axis in self.grid.axes]),
            "figures": json.dumps([figure.name for figure in self.figures]),
            "keep": json.dumps(list(self.keep)),
            "load": self.load,
            "end": self.end,
            "output_step": self.output_step,
            **self._options,
            "error": "energy_error holds the error reached, per run; rtol is the local tolerance",
        }

    def ensemble(self, runs: Sequence[int], jobs: int | None) -> Ensemble:
        """Begin these runs of the grid, numbered anew from 0, on so many threads (all cores)."""
        return ensemble(
            self.machine,
            self.motion,
            self.grid.values(runs),
            load=self.load or None,
            times=self.times,
            keep=self.keep,
            jobs=jobs,
            engine=self.engine,
            rtol=self.rtol,
            method=self.method,
            max_steps=self.max_steps,
            energy=self.energy,
        )

    def differences(self, attributes: Mapping[str, Any], axes: Mapping[str, Any]) -> list[str]:
        """What of a file is not this plan: one text per difference, empty when it is the same."""
        found = [
            *_axes_differences(self.grid, axes),
            *self._machine_differences(Machine.from_toml(attributes["machine"])),
        ]
        if attributes["motion_digest"] != _digest(self.motion, self.times):
            found.append(f"motion: {attributes['motion']} there, {self.motion.text} here")
        if json.loads(attributes["keep"]) != list(self.keep):
            there = ", ".join(json.loads(attributes["keep"])) or "none"
            found.append(f"keep: {there} there, {', '.join(self.keep) or 'none'} here")
        here = {
            "version": __version__,
            "core": core_digest(),
            "load": self.load,
            "end": self.end,
            "output_step": self.output_step,
            **self._options,
        }
        for name, value in here.items():
            if attributes.get(name) != value:
                found.append(f"{name}: {attributes.get(name)} there, {value} here")
        return found

    @property
    def _options(self) -> dict[str, Any]:
        """Those of `simulate`, as the file has them."""
        return {
            "engine": self.engine,
            "method": self.method,
            "rtol": self.rtol,
            "max_steps": self.max_steps or 0,
            "energy": self.energy,
        }

    def _machine_differences(self, there: Machine) -> list[str]:
        """Differences that matter: the value a swept parameter has in the file does not."""
        machine = there.copy()
        with suppress(ValueError):  # not even the parameters agree: said below
            for path in self.grid.point(0):
                machine.core.set(path, self.machine.core.get(path))
        return machine_differences(machine, self.machine)


def _digest(motion: Motion, times: NDArray[np.float64]) -> str:
    """A fingerprint of the commanded angle itself: sampled motions have no telling text."""
    return hashlib.sha256(np.asarray(motion.waveform.value(times)).tobytes()).hexdigest()


def _axes_differences(grid: Grid, there: Mapping[str, Any]) -> list[str]:
    names = [axis.path for axis in grid.axes]
    if list(there) != names:
        return [f"axes: {', '.join(there)} there, {', '.join(names)} here"]
    found = []
    for axis in grid.axes:
        values = np.asarray(there[axis.path])
        if len(values) != len(axis.values):
            found.append(f"{axis.path}: {len(values)} values there, {len(axis.values)} here")
        elif (different := np.flatnonzero(values != axis.values)).size:
            a, b = float(values[different[0]]), float(axis.values[different[0]])
            found.append(f"{axis.path}: {_both(a, b, axis.unit)}")
    return found


def machine_differences(there: Machine, here: Machine) -> list[str]:
    """Parts, effects, choices and numbers in which two machines differ, one text each."""
    views: Sequence[tuple[str, Callable[[Machine], Any]]] = (
        ("bodies", lambda m: m.core.bodies),
        ("connections", lambda m: {c: m.core.kind(c) for c in m.core.connections}),
        ("motors", lambda m: {c: m.core.kind(c) for c in m.core.motors}),
        ("controller", lambda m: m.core.controller_options),
        ("effects", lambda m: m.core.effects),
    )
    found = [
        f"machine.{name}: {view(there)} there, {view(here)} here"
        for name, view in views
        if view(there) != view(here)
    ]
    if found:
        return found
    old = {p.path: p for p in there.parameters()}
    return [
        f"{p.path}: {_both(old[p.path].value, p.value, p.unit)}"
        for p in here.parameters()
        if old[p.path].value != p.value
    ]


def _both(there: float, here: float, unit: str) -> str:
    """Two values as people write them, or in full where that would hide the difference."""
    a, b = units.human(there, unit), units.human(here, unit)
    return f"{a} there, {b} here" if a != b else f"{there!r} there, {here!r} here, {unit}"
