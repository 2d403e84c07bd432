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

__all__ = ["Closure", "close", "scales", "shooting"]

Array = NDArray[np.float64]

_CLOSED = 1e-9  # residual, of each state's size
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
    name, first = flow.machine.name, period
    scale = scales(flow, state, period)
    held = int(np.abs(flow.rate(state, period) / scale).argmax())
    free = np.delete(np.arange(len(state)), held)
    miss = (flow.after(state, period) - state) / scale
    for _ in range(_ITERATIONS):
        size = float(np.abs(miss).max())
        if size < _CLOSED:
            M = flow.monodromy(state, period, scale)
            return _refuse_rest(flow, Closure(state, period, M, size), scale)
        M = flow.monodromy(state, period, scale, state + miss * scale)
        J = (M - np.eye(len(state))) * scale / scale[:, None]
        by_period = flow.rate(state, period) * period / scale
        step = np.linalg.lstsq(np.column_stack([J[:, free], by_period]), -miss, rcond=1e-13)[0]
        for halving in range(_HALVINGS + 1):
            part = step / 2**halving
            longer = period * (1 + part[-1])
            if not 0.3 * first < longer < 3 * first:
                continue
            trial = state.copy()
            trial[free] += part[:-1] * scale[free]
            new = (flow.after(trial, longer) - trial) / scale
            if np.abs(new).max() < (1 - 0.1 / 2**halving) * size or np.abs(new).max() < _CLOSED:
                break
        else:
            break
        state, period, miss = trial, longer, new
    raise NoCycleError(
        f"{name}: no orbit closes near this guess (period {first:.4g} s; best miss "
        f"{np.abs(miss).max():.2g} of the states' size); try another guess"
    )


def _refuse_rest(flow: Flow, found: Closure, scale: Array) -> Closure:
    """A machine at rest repeats itself with any period."""
    moved = np.ptp(flow.along(found.state, found.period), axis=0)
    if (moved <= 1e-6 * scale).all():
        raise NoCycleError(f"{flow.machine.name}: the search ended at rest, not in a cycle")
    return found
