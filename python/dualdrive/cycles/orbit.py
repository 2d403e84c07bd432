"""A periodic orbit: how long, how large, whether it attracts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.cycles.flow import Flow
from dualdrive.display import Displayed
from dualdrive.machine import Machine

__all__ = ["Orbit", "describe", "half_range"]

Array = NDArray[np.float64]

_POINTS = 2000


@dataclass(frozen=True, eq=False)
class Orbit(Displayed, picture="cycle"):
    """An exact periodic orbit of the machine at standstill; SI.

    period:       s
    amplitude:    of the table, half peak to peak, rad
    state:        a point of it, state -> value
    multipliers:  Floquet multipliers, the one of motion along the orbit (1) left out; the largest
                  first, complex, shape (states - 1,)
    along:        that left-out multiplier; how far it is from 1 shows the numerical error
    stable:       whether all multipliers are inside the unit circle
    residual:     how far the orbit misses itself after a period, of each state's own size
    t, signals:   one period: times (n,), name -> values (n,), the first point there twice
    switches:     (time, element, from, to) of every located switch
    """

    machine: Machine = field(repr=False)
    period: float
    amplitude: float
    state: Mapping[str, float] = field(repr=False)
    multipliers: NDArray[np.complex128] = field(repr=False)
    along: complex
    stable: bool
    residual: float
    t: Array = field(repr=False)
    signals: Mapping[str, Array] = field(repr=False)
    switches: tuple[tuple[float, str, str, str], ...] = field(repr=False)

    @property
    def frequency_hz(self) -> float:
        """Of the orbit."""
        return 1.0 / self.period

    @property
    def peak_to_peak(self) -> float:
        """Of the table, rad."""
        return 2 * self.amplitude

    def figures(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "period": self.period,
            "frequency_hz": self.frequency_hz,
            "amplitude": self.amplitude,
            "stable": self.stable,
            "multipliers": [[m.real, m.imag] for m in self.multipliers.tolist()],
            "along": [self.along.real, self.along.imag],
            "residual": self.residual,
            "switches": len(self.switches),
            "state": dict(self.state),
        }


def describe(flow: Flow, state: Array, period: float, monodromy: Array, residual: float) -> Orbit:
    """Everything about an orbit that was found."""
    run = flow.run(state, period, points=_POINTS)
    signals = {name: np.array(run.values[:, k]) for k, name in enumerate(run.names)}
    found = np.linalg.eigvals(monodromy).astype(np.complex128)
    own = int(np.abs(found - 1).argmin())
    rest = np.delete(found, own)
    rest = rest[np.argsort(-np.abs(rest), kind="stable")]
    return Orbit(
        machine=flow.machine.copy(),
        period=period,
        amplitude=half_range(signals["theta_m"]),
        state=dict(zip(flow.states, state.tolist(), strict=True)),
        multipliers=rest,
        along=complex(found[own]),
        stable=bool((np.abs(rest) < 1).all()),
        residual=residual,
        t=np.array(run.t),
        signals=signals,
        switches=tuple(run.events),
    )


def half_range(values: Array) -> float:
    """Half peak to peak, each extreme by the parabola through its three samples."""
    ends = []
    for sign in (1.0, -1.0):
        x = sign * values
        k = int(np.clip(x.argmax(), 1, x.size - 2))
        a, b, c = x[k - 1 : k + 2]
        bend = a - 2 * b + c
        ends.append(b - (c - a) ** 2 / (8 * bend) if bend < 0 and b >= max(a, c) else x.max())
    return float(sum(ends) / 2)
