"""A finished run and a measured trace, seen alike: channels over time, and a machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, cast

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.style import Scale, scale

if TYPE_CHECKING:
    from dualdrive.run import Event, Run
    from dualdrive.traces import Trace

__all__ = ["PlotError", "View", "reversals"]

Array = NDArray[np.float64]

#: share of the largest speed below which a speed counts as standstill when its sign is read
STANDSTILL: Final = 0.02


class PlotError(ValueError):
    """A picture that cannot be drawn from what was given. The message is one line."""


class View:
    """The part of a run or trace inside a window of time, for drawing.

    t:   s, shape (n,)
    run: the run behind it, or None for a trace: only a run has a machine, flanks and events

    Raises PlotError where fewer than two samples lie in the window.
    """

    def __init__(self, source: Run | Trace, window: tuple[float, float] | None = None) -> None:
        self.source = source
        self.run = cast("Run", source) if hasattr(source, "machine") else None
        t = np.asarray(source.t, dtype=np.float64)
        low, high = window or (t[0], t[-1])
        self._inside = (t >= low) & (t <= high)
        self.t: Array = t[self._inside]
        if len(self.t) < 2:
            rule = f"{len(self.t)} samples in {low:g} .. {high:g} s"
            raise PlotError(f"window: {rule}; it must hold two, within {t[0]:g} .. {t[-1]:g} s")

    def __contains__(self, name: str) -> bool:
        return name in self.source.units

    def __getitem__(self, name: str) -> Array:
        """Return the values of a channel in the window, SI, shape (n,). PlotError if absent."""
        if name not in self:
            rule = f"no channel {name!r}; record it, or draw another picture"
            raise PlotError(f"{rule}; there are: {', '.join(self.source.units)}")
        return np.asarray(self.source[name], dtype=np.float64)[self._inside]

    def unit(self, name: str) -> str:
        """The SI unit of a channel."""
        return self.source.units[name]

    def scale(self, *names: str, prefer: str | None = None) -> Scale:
        """One readable unit for channels that share an axis."""
        values = np.concatenate([self[name] for name in names])
        return scale(self.unit(names[0]), values, prefer)

    # --- what several pictures show ---------------------------------------------------------------

    def error(self) -> Array | None:
        """The following error in SI, shape (n,); None without a commanded angle."""
        if "e" in self:
            return self["e"]
        if "theta_ref" in self and "theta_m" in self:
            return self["theta_ref"] - self["theta_m"]
        return None

    def numbered(self, stem: str) -> dict[int, str]:
        """Channels of the drives: {1: "T_1", 2: "T_2"} for the stem "T_"."""
        found = {n: f"{stem}{n}" for n in range(1, 10)}
        return {n: name for n, name in found.items() if name in self}

    def meshes(self) -> list[int]:
        """Numbers of the meshes with play whose twist was recorded; none for a trace."""
        if self.run is None:
            return []
        core = self.run.machine.core
        return [
            n
            for n, name in self.numbered_meshes().items()
            if name in core.connections and core.kind(name) == "gap"
        ]

    def numbered_meshes(self) -> dict[int, str]:
        """Meshes with a recorded twist: {1: "mesh_1", ...}."""
        names = {n: f"mesh_{n}" for n in range(1, 10)}
        return {n: name for n, name in names.items() if f"{name}.deflection" in self}

    def parameter(self, path: str) -> float | None:
        """A number of the run's machine; None for a trace, or where the machine has no such."""
        if self.run is None or path not in {p.path for p in self.run.machine.core.parameters()}:
            return None
        return float(self.run.machine.get(path))

    def events(self, element: str) -> list[Event]:
        """Located switches of one element in the window, in order."""
        if self.run is None:
            return []
        low, high = self.t[0], self.t[-1]
        return [e for e in self.run.events if e.element == element and low <= e.t <= high]

    def moving(self) -> list[tuple[float, float]]:
        """Stretches in which the commanded angle moves; none where that is not known."""
        if "omega_ref" in self:
            speed = self["omega_ref"]
        elif "theta_ref" in self:
            speed = np.gradient(self["theta_ref"], self.t)
        else:
            return []
        return _stretches(self.t, np.abs(speed) > 1e-6 * np.abs(speed).max(initial=1e-300))

    def speed(self) -> tuple[str, Array]:
        """The table's speed, commanded if there is one, and what it is called."""
        for name, what in (("omega_ref", "commanded speed"), ("omega_m", "table speed")):
            if name in self and np.any(self[name]):
                return what, self[name]
        for name, what in (("theta_ref", "commanded speed"), ("theta_m", "table speed")):
            if name in self and np.ptp(self[name]) > 0:
                return what, np.gradient(self[name], self.t)
        raise PlotError("no motion: neither a speed nor an angle of the table changes")


def _stretches(t: Array, inside: NDArray[np.bool_]) -> list[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    last = len(t) - 1
    return [(float(t[a]), float(t[min(b, last)])) for a, b in edges.reshape(-1, 2)]


def reversals(t: Array, speed: Array) -> list[tuple[float, float]]:
    """Return (begin, end) of every reversal: half the speed of the slower side is left, and met.

    A rest between the two directions belongs to the reversal. What is slower than a fiftieth of the
    largest speed has no direction.
    """
    size = np.abs(speed)
    sign = np.where(size > STANDSTILL * size.max(), np.sign(speed), 0.0)
    going = np.flatnonzero(sign)
    if not len(going):
        return []
    turns = np.flatnonzero(np.diff(sign[going]))
    edges = np.concatenate([[0], going[turns + 1], [len(t)]])
    spans = []
    for k, at in enumerate(turns):
        before = np.arange(edges[k], going[at] + 1)
        after = np.arange(going[at + 1], edges[k + 2])
        half = 0.5 * min(size[before].max(), size[after].max())
        leaving = before[size[before] >= half][-1]
        arrived = after[size[after] >= half][0]
        spans.append((float(t[leaving]), float(t[arrived])))
    return spans
