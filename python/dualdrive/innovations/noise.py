"""The noise of a grey box: sensors with a memory, torques of unknown course; its likelihood."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from dualdrive.innovations.records import Predictable

Array = NDArray[np.float64]

_LEAST_MEMORY, _MOST_MEMORY = -0.5, 0.9999
_KNOWN = 0.05  # of the share at the table: a motor's unknown torque
_COURSE = 0.9  # pole over a sample of a torque of unknown course, at first
_STEP = 1e-3  # of a logarithm, for finite differences
_LONGEST = 1.5  # step of a logarithm
_FARTHEST = 14.0  # of a logarithm, from where the search began
_ENOUGH = 1.0  # of -2 log L: a step that brings less ends the search


@dataclass(frozen=True)
class Noise:
    """Standard deviations per sample.

    drive:  kind of channel -> what drives its autoregression of order one, SI of the channel
    memory: kind of channel -> its pole over a sample, 0 white .. 1 a random walk
    torque: body -> what drives the torque of unknown course there, constant over a sample, N*m in
        the body's own frame; empty: the replay is a simulation
    course: pole over a sample of these torques, an autoregression of order one, too
    """

    drive: Mapping[str, float]
    memory: Mapping[str, float]
    torque: Mapping[str, float]
    course: float = 0.0

    def torques(self) -> dict[str, tuple[float, float]]:
        """Body -> (drive, memory)."""
        return {body: (s, self.course) for body, s in self.torque.items()}

    def sensors(self, record: Predictable) -> list[tuple[float, float, float]]:
        """(drive, memory, white part of the rounding) per channel of a record."""
        return [
            (self.drive[kind], self.memory[kind], step / np.sqrt(12.0))
            for kind, step in zip(record.kinds, record.steps, strict=True)
        ]

    def with_torque(self, factor: float) -> Noise:
        """The same with torques of unknown course `factor` times as large."""
        return replace(self, torque={body: factor * s for body, s in self.torque.items()})


def first_noise(core: Any, records: Sequence[Predictable], share: float) -> Noise:
    """A first guess from the records alone, torques wide so that any machine follows them.

    share: of the RMS drive torque, for the torque of unknown course
    """
    rough: dict[str, list[float]] = {}
    for r in records:
        for kind, y in zip(r.kinds, r.measured.T, strict=True):
            # third differences of white noise are sqrt(20) times as large; motion hardly has any
            rough.setdefault(kind, []).append(float(np.std(np.diff(y, 3))) / np.sqrt(20.0))
    drive = {kind: max(float(np.median(s)), 1e-300) for kind, s in rough.items()}
    scale = float(np.sqrt(1.0 - _COURSE**2))
    wide = {body: scale * s for body, s in _wide(core, records, share).items()}
    return Noise(drive, dict.fromkeys(drive, 0.5), wide, _COURSE)


def _wide(core: Any, records: Sequence[Predictable], share: float) -> dict[str, float]:
    """Torque of unknown course at the table and every motor, a share of what the drives gave."""
    squares: dict[str, list[float]] = {}
    for r in records:
        for channel, y in zip(r.channels, r.measured.T, strict=True):
            stem, _, n = channel.partition("_")
            if stem in ("I", "T") and f"motor_{n}" in core.motors:
                factor = core.get(f"motor_{n}.K_d") if stem == "I" else 1.0
                squares.setdefault(f"motor_{n}", []).append(float(np.mean((factor * y) ** 2)))
    known = {motor: float(np.sqrt(np.mean(s))) for motor, s in squares.items()}
    usual = float(np.mean(list(known.values()))) if known else _rated(core)
    found = {motor: share * known.get(motor, usual) for motor in core.motors}
    table = 0.0
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        ratio = 1.0
        for joint in (f"gearbox_{n}", f"mesh_{n}"):
            if joint in core.connections:
                ratio *= core.get(f"{joint}.ratio")
        table += found[motor] * ratio
    # what a motor gives is known from its current; what the table takes is not
    return {**{motor: _KNOWN * s for motor, s in found.items()}, "table": table}


def _rated(core: Any) -> float:
    rated = [core.get(f"{motor}.T_rated") for motor in core.motors]
    finite = [x for x in rated if np.isfinite(x)]
    return 0.1 * float(np.mean(finite)) if finite else 1.0


@dataclass(frozen=True)
class _Coordinates:
    """A noise as a vector of logarithms: drives, memories, torques (motors tied)."""

    noise: Noise
    kinds: tuple[str, ...]
    ties: tuple[str, ...]
    floor: Mapping[str, float]

    def __len__(self) -> int:
        return 2 * len(self.kinds) + len(self.ties) + bool(self.ties)

    def at(self, x: Array) -> Noise:
        """The noise at a vector; zero is the one it was begun with."""
        n, own = len(self.kinds), self.noise
        grown = {k: float(own.drive[k] * np.exp(v)) for k, v in zip(self.kinds, x[:n], strict=True)}
        kept = {
            k: _memory(_logit(own.memory[k]) + v)
            for k, v in zip(self.kinds, x[n : 2 * n], strict=True)
        }
        last = 2 * n + len(self.ties)
        factor = dict(zip(self.ties, np.exp(x[2 * n : last]), strict=True))
        course = _memory(_logit(own.course) + x[last]) if self.ties else own.course
        torque = {
            body: max(float(s * factor.get(_tie(body), 1.0)), self.floor.get(body, 0.0))
            for body, s in own.torque.items()
        }
        return Noise({**own.drive, **grown}, {**own.memory, **kept}, torque, course)


    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest of every logarithm; a memory's are those of a pole."""
        far = np.full(len(self), _FARTHEST)
        low, high, n = -far, far.copy(), len(self.kinds)
        poles = [(n + k, self.noise.memory[kind]) for k, kind in enumerate(self.kinds)]
        if self.ties:
            poles.append((len(self) - 1, self.noise.course))
        for k, pole in poles:
            low[k], high[k] = _logit(_LEAST_MEMORY) - _logit(pole), _logit(_MOST_MEMORY) - _logit(pole)
        return np.minimum(low, 0.0), np.maximum(high, 0.0)


#: innovations (whitened, flat) and log det of each noise, None where no filter is steady
Evaluate = Callable[[Sequence[Noise]], "list[tuple[Array, float] | None]"]


def maximum_likelihood(
    noise: Noise,
    evaluate: Evaluate,
    *,
    sensors: bool = True,
    torques: bool = True,
    floor: Mapping[str, float] | None = None,
    steps: int = 10,
) -> tuple[Noise, float]:
    """The noise under which records are likeliest, the machine held; and -2 log L there.

    Fisher scoring on logarithms: the gradient of chi^2 + log det by finite differences, the
    curvature from the derivatives of the whitened innovations.

    Args:
        noise: where to begin.
        evaluate: of `GreyBox.under`.
        sensors: whether the sensors' noise is estimated.
        torques: whether the torques of unknown course are.
        floor: body -> least torque of unknown course.
        steps: most iterations.

    """
    own = _Coordinates(
        noise,
        tuple(sorted(noise.drive)) if sensors else (),
        tuple(sorted({_tie(body) for body in noise.torque})) if torques else (),
        dict(floor or {}),
    )
    x = np.zeros(len(own))
    low, high = own.bounds()
    [first] = evaluate([own.at(x)])
    if first is None:
        return noise, np.inf
    r, det = first
    cost = float(r @ r) + det
    damping = 1e-3
    for _ in range(steps):
        inward = np.where(x + _STEP > high, -_STEP, _STEP)
        moved = evaluate([own.at(x + e) for e in np.diag(inward)])
        J = np.stack(
            [(m[0] - r) / s if m else np.zeros_like(r) for m, s in zip(moved, inward, strict=True)]
        )
        slope = np.array([(m[1] - det) / s if m else 0.0 for m, s in zip(moved, inward, strict=True)])
        g, H = 2.0 * (J @ r) + slope, 2.0 * (J @ J.T)
        better: tuple[Array, tuple[Array, float], float] | None = None
        for _ in range(3):
            damped = H + damping * np.diag(np.diag(H)) + 1e-9 * np.eye(len(x))
            d = _step_within(
                damped, g, np.maximum(low - x, -_LONGEST), np.minimum(high - x, _LONGEST)
            )
            trials = [x + a * d for a in (1.0, 0.5)]
            tried = [
                (t, f, float(f[0] @ f[0]) + f[1])
                for t, f in zip(trials, evaluate([own.at(t) for t in trials]), strict=True)
                if f
            ]
            best = min(tried, key=lambda t: t[2], default=None)
            if best and best[2] < cost:
                better = best
                break
            damping *= 30.0
        if better is None:
            break
        fall = cost - better[2]
        x, (r, det), cost = better
        damping = max(1e-4, damping / 10.0)
        if fall < _ENOUGH:
            break
    return own.at(x), cost


def _step_within(H: Array, g: Array, low: Array, high: Array) -> Array:
    """Newton step in a box: what the records hardly tell may not shorten what they tell."""
    d, held = np.zeros(len(g)), np.zeros(len(g), dtype=bool)
    for _ in range(len(g)):
        move = ~held
        d[move] = -np.linalg.solve(H[np.ix_(move, move)], g[move] + H[np.ix_(move, held)] @ d[held])
        beyond = move & ((d > high) | (d < low))
        if not beyond.any():
            break
        d[beyond] = np.clip(d, low, high)[beyond]
        held |= beyond
    return d


def _tie(body: str) -> str:
    """Motors are alike."""
    return body.rpartition("_")[0] if body.rpartition("_")[2].isdigit() else body


def _logit(memory: float) -> float:
    return float(np.log((1.0 + memory) / (1.0 - memory)))


def _memory(x: float) -> float:
    return float(np.clip(np.tanh(0.5 * x), _LEAST_MEMORY, _MOST_MEMORY))
