"""The grid of a sweep: axes named by parameter, every combination of their values one run."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dualdrive import units

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from dualdrive.machine import Machine

__all__ = ["ALIASES", "Axis", "Grid", "GridError", "lay_out"]

#: short names of parameters on axes
ALIASES: Final = {"delta": "meshes.gap"}

#: more points than this on one axis, or runs in one file, is a slip of the keyboard
MOST_POINTS: Final = 1_000_000
MOST_RUNS: Final = 10_000_000


class GridError(ValueError):
    """An axis or grid that cannot be swept. The message is one line."""


@dataclass(frozen=True)
class Axis:
    """A parameter (path or tie group), the SI values it takes in order, and what it is."""

    path: str
    values: NDArray[np.float64]
    unit: str
    long_name: str
    members: tuple[str, ...]

    def __str__(self) -> str:
        low, high = (units.human(float(v), self.unit) for v in (self.values[0], self.values[-1]))
        n = len(self.values)
        return f"{self.path} {low} to {high} ({n} values)" if n > 1 else f"{self.path} = {low}"


@dataclass(frozen=True)
class Grid:
    """Axes in order; runs are numbered row by row, the last axis fastest."""

    axes: tuple[Axis, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values on each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def size(self) -> int:
        """Number of runs."""
        return math.prod(self.shape)

    def point(self, run: int) -> dict[str, float]:
        """The value of every axis in this run: path -> SI value."""
        index = np.unravel_index(run, self.shape)
        return {a.path: float(a.values[i]) for a, i in zip(self.axes, index, strict=True)}

    def values(self, runs: Sequence[int]) -> dict[str, NDArray[np.float64]]:
        """The values of every axis in these runs: path -> SI values, shape (runs,)."""
        indices = np.unravel_index(np.asarray(runs, int), self.shape)
        return {a.path: a.values[i] for a, i in zip(self.axes, indices, strict=True)}

    def machine(self, base: Machine, run: int) -> Machine:
        """The machine of this run: a copy of `base` with the values of the run."""
        machine = base.copy()
        for path, value in self.point(run).items():
            machine.core.set(path, value)
        return machine


def lay_out(machine: Machine, axes: Mapping[str, str | ArrayLike]) -> Grid:
    """Check axes against a machine and return their grid.

    axes: parameter path or tie group (or ``delta``) -> values: numbers in SI, texts with units, or
          one text ``start:stop:count`` or ``a,b,c``

    Raises GridError naming axis, value, rule and way out.
    """
    if not axes:
        raise GridError("no axis to sweep; give one, e.g. --delta 0:1e-3:20")
    grid = Grid(tuple(_axis(machine, path, values) for path, values in axes.items()))
    taken: dict[str, str] = {}
    for name, axis in zip(axes, grid.axes, strict=True):
        for member in axis.members:
            if member in taken:
                raise GridError(f"{name}: sets {member}, as {taken[member]} does; give one of them")
            taken[member] = name
    if grid.size > MOST_RUNS:
        counts = " x ".join(map(str, grid.shape))
        rule = f"a sweep has at most {MOST_RUNS:,}"
        raise GridError(f"the grid has {counts} = {grid.size:,} runs; {rule}: take fewer points")
    return grid


def _axis(machine: Machine, name: str, given: str | ArrayLike) -> Axis:
    path = ALIASES.get(name, name)
    trial = machine.copy()
    try:
        parameter = machine.parameter(path)
        values = _values(trial, name, path, given)
        for value in (values.min(), values.max()):  # bounds are an interval
            trial.set(path, float(value))
    except ValueError as error:
        text = str(error)
        raise GridError(text if text.startswith(name) else f"{name}: {text}") from None
    _check_distinct(name, values, parameter.unit)
    members = tuple(machine.core.members(path))
    return Axis(path, values, parameter.unit, parameter.doc, members)


def _values(machine: Machine, name: str, path: str, given: str | ArrayLike) -> NDArray[np.float64]:
    """Values in SI, shape (n,), n >= 1, all finite."""
    unit = machine.parameter(path).unit

    def plain(part: str) -> str:
        """A percentage as the SI number it stands for: the machine knows of what."""
        if "%" not in part:
            return part
        machine.set(path, part.strip())
        return repr(machine.get(path))

    if isinstance(given, str):
        _check_count(given)
        text = "".join(map(plain, re.split("([:,])", given)))
        return units.parse_values(text, unit, key=name)
    parts: list[str | float] = np.atleast_1d(np.asarray(given, dtype=object)).ravel().tolist()
    if not parts:
        raise GridError("no values; give at least one")
    if len(parts) > MOST_POINTS:
        raise GridError(f"{len(parts):,} values; an axis has at most {MOST_POINTS:,}")
    return np.array(
        [units.parse(plain(p) if isinstance(p, str) else p, unit, key=name) for p in parts]
    )


def _check_count(text: str) -> None:
    """Before the values are made: a slip of the keyboard must not fill the memory."""
    count = re.fullmatch(r".*:\s*0*(\d+)\s*", text)
    if count and (len(count[1]) > 12 or int(count[1]) > MOST_POINTS):
        raise GridError(f"{text!r}: an axis has at most {MOST_POINTS:,} points; take fewer")


def _check_distinct(name: str, values: NDArray[np.float64], unit: str) -> None:
    """An axis with a value twice could not be looked up by value."""
    distinct, counts = np.unique(values, return_counts=True)
    if len(distinct) < len(values):
        twice = units.human(float(distinct[counts > 1][0]), unit)
        raise GridError(f"{name}: {twice} occurs more than once; every value of an axis once")
