"""How far apart two machines' records of one experiment lie, by what noise leaves uncertain.

The record that machine A would make is fitted by machine B, its nominal numbers, the numbers of its
effect and the constants of the sensors free within their beliefs:

    distance = min over u of  || (y_B(u) - y_A) / sigma ||^2 + || (u - u_B) / sigma_u ||^2

Near the start that is ||(I - P)(y_B - y_A)||^2 with the projection P on what B could imitate; a few
Gauss-Newton steps follow where the answer bends. Noise that stays alike for a while makes fewer
witnesses: samples count as if they were `spacing` apart.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.estimation.unknowns import Unknown, default_free, unknowns
from dualdrive.identify.closed_loop import FitError, Problem
from dualdrive.motion import Motion
from dualdrive.replay import Record, play, records
from dualdrive.traces import CHANNELS, Trace

Array = NDArray[np.float64]

RTOL = 1e-6  # local tolerance: far below any sensor's noise
#: samples of a planned record; more would cost time and tell no more
SAMPLES = 3000
#: of an integration; a machine that takes more chatters
MAX_STEPS = 1_000_000
_NAME = "next"
_SETTLED = 0.02  # a step that takes off a smaller share ends the search
_HALVINGS = 4
#: relative tolerance of an effect's number: the record it was fitted to still holds it there
_FITTED = 0.2
_SHIFT = 0.3  # sigmas by which the numbers of a twin are off


@dataclass(frozen=True)
class Noise:
    """RMS noise per compared channel, SI, and the time between samples of independent noise, s."""

    rms: Mapping[str, float]
    spacing: float = 5e-3

    def weight(self, channel: str, step: float) -> float:
        """Of one sample of a record sampled every `step` s."""
        return math.sqrt(step / self.spacing) / self.rms[channel]


def expected(core: Any, motion: Motion, channels: Sequence[str]) -> Trace | None:
    """The record that a machine would make, without noise; None where it does not simulate."""
    signals = {name for name, _, _ in core.signals()}
    asked = {raw for name in channels for raw in _recorded(name)}
    asked |= {f"T_{motor.rpartition('_')[2]}" for motor in core.motors}
    t = np.linspace(_begin(motion), motion.end, SAMPLES)
    line = t - t[0]  # stands in for a recording: a channel that varies, and begins at zero
    blank = Trace(t, dict.fromkeys(sorted(asked & signals & set(CHANNELS)), line))
    [record] = records(core, {_NAME: blank}, motion=motion, start="settled")
    try:
        replay = play(core, record, rtol=RTOL, max_steps=MAX_STEPS)
    except ValueError:
        return None
    if not replay.ok:
        return None
    return Trace(t, {name: replay.simulated[name] for name in blank}, name=_NAME)


def beliefs(core: Any, known: Mapping[str, float] | None = None) -> list[Unknown]:
    """Every number that may move, within the data sheet's tolerance or that of the first fit.

    A delay that is switched off stays off: without it the machine is another one.

    known: path -> standard deviation that the first fit left, SI, where it is known; the strength
        of an effect is held within a fifth of itself otherwise, a phase not at all
    """
    return [
        replace(p, sigma=_width(p, known or {}))
        for p in unknowns(core, default_free(core), None, {})
        if p.nominal != 0.0 or p.low <= 0.0
    ]


def _width(p: Unknown, known: Mapping[str, float]) -> float:
    """One sigma in the unknown's own coordinate, never wider than what was believed before."""
    if p.path in known:
        return min(p.sigma, max(known[p.path] / abs(p.slope(p.coordinate(p.nominal))), 1e-6))
    if "@" not in p.path or p.nominal == 0.0:
        return p.sigma
    return math.inf if p.path.endswith("phase") else min(p.sigma, _FITTED)


def effect_numbers(core: Any) -> int:
    """How many numbers of effects a fit of this machine moves."""
    return sum("@" in path for path in default_free(core))


def ready(core: Any, record: Trace, motion: Motion) -> Record:
    """A record of an experiment, ready to be played: the drives had held the axis for long."""
    return records(core, {_NAME: record}, motion=motion, start="settled")[0]


def misfit(
    core: Any,
    record: Trace,
    motion: Motion,
    noise: Noise,
    *,
    steps: int = 8,
    known: Mapping[str, float] | None = None,
) -> tuple[float, float]:
    """What a machine leaves of a record after its own numbers have moved to meet it.

    known: see `beliefs`

    Returns:
        The squared distance reached in `steps` Gauss-Newton steps, and what the first one foretold;
        infinite where the machine does not simulate.

    """
    played = ready(core, record, motion)
    free = beliefs(core, known)
    named = [name for name in played.names if name in noise.rms]
    problem = Problem(core, [played], free, [], channels=named, rtol=RTOL)
    problem.max_steps = MAX_STEPS
    step = float(played.t[-1] - played.t[0]) / (len(played.t) - 1)
    problem.weights = {row: noise.weight(row[1], step) for row in problem.rows}
    return _descended(problem, steps)


def twin(core: Any, sign: int) -> Any:
    """A copy with every nominal number off by part of its tolerance, up and down in turn.

    sign: 1 or -1, which way it begins
    """
    own = core.copy()
    nominal = [p for p in beliefs(core) if "@" not in p.path]
    for k, p in enumerate(nominal):
        shift = sign * (-1) ** k * _SHIFT * p.sigma
        own.set(p.path, p.value(p.coordinate(p.nominal) + shift))
    return own


def _descended(problem: Problem, steps: int) -> tuple[float, float]:
    u, (low, high) = problem.prior.mean, problem.bounds
    u = np.clip(
        u, np.where(np.isfinite(low), low, -1e300), np.where(np.isfinite(high), high, 1e300)
    )
    left = problem.residual(u)
    cost, foretold = _square(left), math.inf
    for k in range(max(steps, 1)):
        if not math.isfinite(cost):
            break
        try:
            slope = problem.jacobian(u)
        except (FitError, ValueError):
            break
        move, promised = _step(slope, left)
        foretold = promised if k == 0 else foretold
        if steps == 0 or cost - promised < _SETTLED * cost:
            break
        taken = _line(problem, u, move, cost, (low, high))
        if taken is None:
            break
        (u, left), before, cost = taken, cost, _square(taken[1])
        if before - cost < _SETTLED * before:
            break
    return cost, min(foretold, cost)


def _step(slope: Array, left: Array) -> tuple[Array, float]:
    """The Gauss-Newton step, columns scaled alike, and the square that it promises."""
    size = np.linalg.norm(slope, axis=0)
    size[size == 0.0] = 1.0
    move: Array = np.linalg.lstsq(slope / size, -left, rcond=1e-9)[0] / size
    return move, _square(left + slope @ move)


def _line(
    problem: Problem, u: Array, move: Array, cost: float, bounds: tuple[Array, Array]
) -> tuple[Array, Array] | None:
    """The first of a step and its halves that lowers the cost."""
    for halving in range(_HALVINGS):
        trial = np.clip(u + 0.5**halving * move, *bounds)
        left = problem.residual(trial)
        if _square(left) < cost:
            return trial, left
    return None


def _square(left: Array) -> float:
    return float(left @ left) if np.isfinite(left).all() else math.inf


def _begin(motion: Motion) -> float:
    """Half a second before the motion starts: what was before says nothing."""
    return max(0.0, float(motion.arguments.get("start", 0.0)) - 0.5)


def _recorded(name: str) -> tuple[str, ...]:
    """The recorded channels behind a compared one: x_1 is made of theta_1 and theta_m."""
    if name == "e":
        return ("theta_m",)
    if name.startswith("x_"):
        return ("theta_m", f"theta_{name[2:]}")
    return (name,)
