"""Cycles over a grid of numbers: where the machine hunts, how fast and how far."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.cycles.errors import CycleError
from dualdrive.cycles.orbit import Orbit
from dualdrive.cycles.shooting_method import shooting
from dualdrive.display import Displayed
from dualdrive.machine import Machine

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Survey", "survey"]

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Survey(Displayed, picture="cycle_map"):
    """Cycles by grid point, None where none was found.

    axes:    path -> values, SI, in the order of the grid's dimensions
    orbits:  index -> what was found there
    reasons: index -> why nothing was
    """

    machine: Machine = field(repr=False)
    axes: Mapping[str, Array]
    orbits: Mapping[tuple[int, ...], Orbit] = field(repr=False)
    reasons: Mapping[tuple[int, ...], str] = field(repr=False)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the grid."""
        return tuple(len(values) for values in self.axes.values())

    def grid(self, figure: str) -> np.ma.MaskedArray[Any, Any]:
        """An orbit's frequency_hz, amplitude, peak_to_peak or stable; masked where none is."""
        found = np.ma.array(np.zeros(self.shape), mask=True)
        for index, orbit in self.orbits.items():
            found[index] = float(getattr(orbit, figure))
        return np.ma.asarray(found)

    def to_xarray(self) -> xr.Dataset:
        """Frequency, amplitude and stability over the axes; NaN, or 0, where no cycle is."""
        import xarray as xr

        names = list(self.axes)
        return xr.Dataset(
            {
                "frequency": (names, self.grid("frequency_hz").filled(np.nan), {"units": "Hz"}),
                "amplitude": (names, self.grid("amplitude").filled(np.nan), {"units": "rad"}),
                "cycle": (names, ~np.ma.getmaskarray(self.grid("amplitude"))),
                "stable": (names, self.grid("stable").filled(0).astype(bool)),
            },
            coords={name: (name, values) for name, values in self.axes.items()},
        )

    def figures(self) -> dict[str, Any]:
        """Plain numbers for JSON, point by point."""
        points = []
        for index in np.ndindex(*self.shape):
            at = {n: float(v[k]) for (n, v), k in zip(self.axes.items(), index, strict=True)}
            orbit = self.orbits.get(index)
            found = orbit.figures() if orbit else {"none": self.reasons[index]}
            points.append({"at": at, **found})
        return {"axes": {n: v.tolist() for n, v in self.axes.items()}, "points": points}


def survey(
    machine: Machine,
    axes: Mapping[str, ArrayLike],
    *,
    kick: float = 1e-3,
    settle: float = 60.0,
    progress: Progress | None = None,
) -> Survey:
    """Look for a cycle at every point of a grid.

    axes:          parameter path or tie group -> values, SI
    kick, settle:  as of `shooting`

    A point is begun from its neighbour's orbit, else from what a kick of the table leaves. Where a
    machine comes to rest after that kick there may still be a cycle that a larger one would start.
    Raises CycleError for an axis without values.
    """
    grid = {path: np.atleast_1d(np.asarray(values, float)) for path, values in axes.items()}
    if not grid or any(values.size == 0 for values in grid.values()):
        raise CycleError("survey: needs at least one axis with values")
    shape = tuple(values.size for values in grid.values())
    orbits: dict[tuple[int, ...], Orbit] = {}
    reasons: dict[tuple[int, ...], str] = {}
    total = int(np.prod(shape))
    for done, index in enumerate(product(*map(range, shape))):
        m = machine.copy()
        for (path, values), k in zip(grid.items(), index, strict=True):
            m.set(path, float(values[k]))
        found, reason = _at(m, _neighbours(index, orbits), kick, settle)
        if found:
            orbits[index] = found
        else:
            reasons[index] = reason
        if progress:
            progress(done + 1, total)
    return Survey(machine.copy(), grid, orbits, reasons)


def _neighbours(index: tuple[int, ...], orbits: Mapping[tuple[int, ...], Orbit]) -> list[Orbit]:
    """Orbits one step back along each axis, the last axis first."""
    found = []
    for axis in reversed(range(len(index))):
        near = tuple(k - (axis == place) for place, k in enumerate(index))
        if near in orbits:
            found.append(orbits[near])
    return found


def _at(
    machine: Machine, near: list[Orbit], kick: float, settle: float
) -> tuple[Orbit | None, str]:
    """The orbit that attracts at one point, or why there is none."""
    for guess in near:
        try:
            orbit = shooting(machine, guess)
        except CycleError:
            continue
        if orbit.stable:
            return orbit, ""
    try:
        return shooting(machine, kick=kick, settle=settle), ""
    except CycleError as error:
        return None, str(error)
