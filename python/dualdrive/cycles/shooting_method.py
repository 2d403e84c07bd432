"""Periodic orbits found by shooting: Newton's method on the map over one period.

    phi_T(z) - z = 0,  one state of z held where it is (it says at which phase the orbit begins)

d phi / dz is the monodromy matrix; its eigenvalues are the Floquet multipliers. Source: Parker,
Chua, *Practical Numerical Algorithms for Chaotic Systems*, 1989, ch. 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.cycles.describing import Predicted
from dualdrive.cycles.errors import CycleError, NoCycleError
from dualdrive.cycles.flow import Flow
from dualdrive.cycles.guesses import from_prediction, from_simulation
from dualdrive.cycles.orbit import Orbit, describe
from dualdrive.linear.contacts import frozen
from dualdrive.machine import Machine

__all__ = ["Closure", "close", "refuse_rest", "scales", "shooting"]

Array = NDArray[np.float64]

_CLOSED = 1e-9  # miss, of each state's size
_ROUNDED = 1e-7  # miss that is taken where rounding leaves no better
_ITERATIONS = 25
_HALVINGS = 6


def shooting(
    machine: Machine,
    guess: str | Predicted | Orbit = "simulation",
    *,
    kick: float = 1e-3,
    settle: float = 60.0,
) -> Orbit:
    """The periodic orbit of a machine whose command stands still, stable or not.

    guess:   simulation (what a kick of the table leaves after `settle`: finds what attracts),
             "describing function" or one of its predictions (finds what repels as well), or an
             orbit of a similar machine
    kick:    initial speed of the table, rad/s
    settle:  s

    Raises CycleError for a machine that can't be asked, NoCycleError where no cycle starts or the
    search from that guess does not close.
    """
    flow = Flow(machine.copy())
    if isinstance(guess, Orbit):
        state, period = np.array([guess.state[name] for name in flow.states]), guess.period
    elif isinstance(guess, Predicted):
        state, period = from_prediction(flow, guess)
    elif guess == "simulation":
        state, period = from_simulation(flow, kick, settle)
    elif guess == "describing function":
        state, period = from_prediction(flow)
    else:
        raise CycleError(f"guess = {guess!r}: choose simulation, describing function or an Orbit")
    found = close(flow, state, period)
    return describe(flow, found.state, found.period, found.monodromy, found.residual)


@dataclass(frozen=True, eq=False)
class Closure:
    """A point, a period and the map's derivative there."""

    state: Array
    period: float
    monodromy: Array
    residual: float


def scales(flow: Flow, state: Array, period: float) -> Array:
    """The size of each state along a motion.

    A state that stays at zero has none; it is given what would matter to the others: a thousandth
    of what moves one of them by its own size in a period.
    """
    sizes = np.abs(flow.along(state, period)).max(0)
    A = np.abs(_core.linearise(flow.core, flow.inputs, modes=frozen(flow.core, None)).A)
    for _ in range(2):  # a filter before an integrator: its size comes second
        alive = sizes > 1e-9 * np.abs(A @ sizes) * period
        alive &= sizes > 0
        reach = (A[alive] * period / sizes[alive, None]).max(0, initial=0.0)
        matters = np.divide(1e-3, reach, out=np.zeros_like(reach), where=reach > 0)
        sizes = np.maximum(sizes, matters)
    return np.where(sizes > 0, sizes, 1.0)


def close(flow: Flow, state: Array, period: float) -> Closure:
    """Newton's method from a guess. Raises NoCycleError where it does not close an orbit."""
    search = _Search(flow, scales(flow, state, period), state, period)
    now = _Point(state, period, search.miss(state, period))
    for _ in range(_ITERATIONS):
        better = None if now.size < _CLOSED else search.improve(now)
        if better is None:
            break
        now = better
    if now.size < _ROUNDED:
        M = flow.monodromy(now.state, now.period, search.scale)
        refuse_rest(flow, now.state, now.period, search.scale)
        return Closure(now.state, now.period, M, now.size)
    raise NoCycleError(
        f"{flow.machine.name}: no orbit closes near this guess (period {period:.4g} s; best miss "
        f"{now.size:.2g} of the states' size); try another guess"
    )


@dataclass(frozen=True, eq=False)
class _Point:
    """A state, a period, and by how much the orbit misses, of each state's size."""

    state: Array
    period: float
    miss: Array

    @property
    def size(self) -> float:
        return float(np.abs(self.miss).max())


class _Search:
    """Newton steps in the scaled state, one coordinate of it held, and the period."""

    def __init__(self, flow: Flow, scale: Array, state: Array, period: float) -> None:
        self.flow, self.scale, self.first = flow, scale, period
        held = int(np.abs(flow.rate(state, period) / scale).argmax())
        self.free = np.delete(np.arange(len(state)), held)

    def miss(self, state: Array, period: float) -> Array:
        """Where the orbit is after a period, less where it began."""
        return np.asarray((self.flow.after(state, period) - state) / self.scale)

    def improve(self, now: _Point) -> _Point | None:
        """A point that misses by less, on the way of a Newton step; None where there is none."""
        step = self._newton(now)
        for halving in range(_HALVINGS + 1):
            part = step / 2**halving
            period = now.period * (1 + part[-1])
            if not 0.3 * self.first < period < 3 * self.first:
                continue
            state = now.state.copy()
            state[self.free] += part[:-1] * self.scale[self.free]
            trial = _Point(state, period, self.miss(state, period))
            if trial.size < max((1 - 0.1 / 2**halving) * now.size, _CLOSED):
                return trial
        return None

    def _newton(self, now: _Point) -> Array:
        scale, after = self.scale, now.state + now.miss * self.scale
        M = self.flow.monodromy(now.state, now.period, scale, after)
        J = (M - np.eye(scale.size)) * scale / scale[:, None]
        by_period = self.flow.rate(now.state, now.period) * now.period / scale
        columns = np.column_stack([J[:, self.free], by_period])
        return np.asarray(np.linalg.lstsq(columns, -now.miss, rcond=1e-13)[0])


def refuse_rest(flow: Flow, state: Array, period: float, scale: Array) -> None:
    """A machine at rest repeats itself with any period. Raises NoCycleError."""
    moved = np.ptp(flow.along(state, period), axis=0)
    if (moved <= 1e-6 * scale).all():
        raise NoCycleError(f"{flow.machine.name}: the search ended at rest, not in a cycle")
