"""The edge of vibration: where raising a gain makes a pole grow, and whether the machine agrees."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.assembly import gaps
from dualdrive.linear.contacts import closed, frozen
from dualdrive.linear.stability import least_damped, worst_pole
from dualdrive.machine import Machine
from dualdrive.motion import default_motion
from dualdrive.simulation import simulate

__all__ = [
    "CLOSED",
    "GAIN",
    "Edge",
    "contacts",
    "damping",
    "find_edge",
    "gain_range",
    "measured_edge",
]

Array = NDArray[np.float64]

GAIN = "controller.K_v"
CLOSED = "all flanks closed"
_POINTS = 50
_LOAD = 0.2  # of the rated torque, so that all flanks stay closed
_PUSH = 0.05  # of that load
_GONE = 1e-4  # of a push: what is left then says nothing of growth
_LADDER = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.98, 1.02, 1.1, 1.25)  # delays lower an edge


@dataclass(frozen=True, eq=False)
class Edge:
    """Where a gain meets the edge of vibration, per contact.

    found:     contact in words -> (gain, Hz of the vibration that begins there); only those where
               a pole grows below `searched`
    gains, growth: what was looked at: largest real part, 1/s, per contact, shape (n,)
    """

    found: dict[str, tuple[float, float]]
    searched: float
    gains: Array
    growth: dict[str, Array]

    @property
    def value(self) -> float | None:
        """The gain at the edge with all flanks closed; None where nothing grows."""
        return self.found[CLOSED][0] if CLOSED in self.found else None

    @property
    def frequency_hz(self) -> float | None:
        """Of the vibration that begins there."""
        return self.found[CLOSED][1] if CLOSED in self.found else None

    @property
    def lowest(self) -> float | None:
        """The gain at the lowest edge of any contact."""
        return min((gain for gain, _ in self.found.values()), default=None)


def contacts(machine: Machine) -> dict[str, tuple[int, ...]]:
    """Contacts worth a look: all flanks closed, then those of one drive open."""
    every, plays = closed(machine), gaps(machine.core)
    found = {CLOSED: every}
    for n in (1, 2):
        sides = tuple(0 if g.endswith(f"_{n}") else s for g, s in zip(plays, every, strict=True))
        found[f"flanks of drive {n} open"] = sides
    return found if plays else {CLOSED: ()}


def damping(
    machine: Machine, sides: tuple[int, ...], state: Mapping[str, float] | None = None
) -> float:
    """The least damping ratio of a vibration in this contact; 1 where nothing vibrates."""
    pole = least_damped(machine, sides, state)
    return 1.0 if pole is None else -pole.real / abs(pole)


def find_edge(
    machine: Machine,
    path: str,
    low: float,
    high: float,
    state: Mapping[str, float] | None = None,
) -> Edge:
    """The least gain in (low, high) from which on a pole grows, in each contact.

    By eigenvalues: exact for small vibrations of a table that moves, so that friction slides.
    state: the operating point of laws that aren't affine
    """
    from scipy.optimize import brentq

    trial = machine.copy()
    gains = np.geomspace(low, high, _POINTS)

    def rate(gain: float, sides: tuple[int, ...]) -> float:
        trial.core.set(path, gain)
        return worst_pole(trial, sides, state).real

    growth, found = {}, {}
    for name, sides in contacts(machine).items():
        rates = np.array([rate(gain, sides) for gain in gains])
        growth[name] = rates
        for k in np.flatnonzero(rates >= 0.0)[:1]:
            edge = float(gains[0])
            if k:
                edge = float(brentq(rate, gains[k - 1], gains[k], args=(sides,), rtol=1e-9))
            trial.core.set(path, edge)
            found[name] = (edge, abs(worst_pole(trial, sides, state).imag) / math.tau)
    return Edge(found, high, gains, growth)


def gain_range(machine: Machine) -> tuple[float, float]:
    """Position gains worth a look, 1/s: up to the speed loop's own rate, k_p over the inertia.

    Beyond it the position loop would be faster than the loop inside it.
    """
    core = machine.core
    inertia = core.get("gearbox_1.ratio") ** 2 * core.get("motor_1.J") + core.get("pinion_1.J")
    high = max(core.get("controller.k_p") / inertia, 4.0 * core.get(GAIN))
    return 1e-3 * high, high


def measured_edge(machine: Machine, path: str, near: float, frequency_hz: float) -> float | None:
    """The edge by simulation of the whole nonlinear machine, near a gain; None if it is not there.

    The table turns steadily under a load that closes all flanks; a push is given, and what is left
    of it after some periods is held against what it was before. Halving between a gain at which it
    dies out and one at which it grows.
    """
    trial = machine.copy()
    trial.core.set("controller.T_ten", 0.0)  # a constant: it moves no pole, but would open a flank
    speed = 0.5 * default_motion(machine).arguments["v"]

    def grows(gain: float) -> bool:
        trial.core.set(path, gain)
        return pushed(trial, frequency_hz, speed) > 0.0

    return _boundary(grows, near)


def _boundary(grows: Callable[[float], bool], near: float, within: float = 2e-3) -> float | None:
    steps = [near * factor for factor in _LADDER]
    answers = [grows(gain) for gain in steps]
    if all(answers) or not any(answers):
        return None
    first = answers.index(True)
    if first == 0:
        return None
    low, high = steps[first - 1], steps[first]
    while high - low > within * high:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return (low + high) / 2


def pushed(machine: Machine, frequency_hz: float, speed: float) -> float:
    """Growth of a small vibration in steady rotation, 1/s; infinite where flanks begin to open.

    speed: of the table, rad/s
    """
    core, period = machine.core, 1.0 / frequency_hz
    load = _LOAD * sum(
        core.get(f"motor_{n}.T_rated")
        * core.get(f"gearbox_{n}.ratio")
        * core.get(f"mesh_{n}.ratio")
        for n in (1, 2)
    )
    push = 10 * period
    end = push + 22 * period
    times = np.array([0.0, push, push + period / 4, push + period / 2, end])
    run = simulate(
        machine,
        inputs={"theta_ref": _core.ramp(speed)},
        end=end,
        load=(times, load * np.array([1.0, 1.0, 1.0 + _PUSH, 1.0, 1.0])),
        initial=_steady(core, closed(machine), speed, load),
        signals=["e"],
        output_step=period / 40,
        energy=False,
    )
    flanks = gaps(core)
    if not run.ok or any(event.element in flanks for event in run.events):
        return math.inf
    at_push, early, late = (
        _size(run.t, run["e"], push + k * period, 8 * period) for k in (0, 3, 13)
    )
    if late <= _GONE * at_push:
        return -math.inf
    return math.log(late / early) / (10 * period)


def _steady(
    core: _core.Machine, sides: tuple[int, ...], speed: float, load: float
) -> dict[str, float]:
    """States in steady rotation, flanks closed: z0 + z1 t solves dz/dt = A z + a0 + a1 t."""
    inputs = {"theta_ref": _core.ramp(speed, -1.0), "T_load": _core.constant(load)}
    inputs["theta_ref"] = _core.sum([inputs["theta_ref"], _core.constant(-speed)])
    modes = frozen(core, sides)
    now, later = (_core.linearise(core, inputs, modes=modes, t=t) for t in (0.0, 1.0))
    A = np.array(now.A)
    z1 = np.linalg.lstsq(A, now.a - later.a, rcond=None)[0]
    z0 = np.linalg.lstsq(A, z1 - now.a, rcond=None)[0]
    return dict(zip(now.states, z0.tolist(), strict=True))


def _size(t: Array, e: Array, begin: float, length: float) -> float:
    """RMS around a straight line over a window."""
    from scipy.signal import detrend

    part = e[(t >= begin) & (t < begin + length)]
    return float(np.std(detrend(part)))
