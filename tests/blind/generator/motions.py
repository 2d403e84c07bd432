"""Commanded motions of every kind, as cubic pieces of even length.

A command is drawn on `KNOT`s: a smooth one exactly, one with corners (ramps, steps) on the
recorder's own clock, as a numerical control puts out straight lines from set-point to set-point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator
KNOT = 2.5e-4


@dataclass(frozen=True)
class Limits:
    """What the machine can do: table speed, acceleration, and how fast it answers (1/s).

    natural: rad/s at which drives and table swing against each other
    """

    speed: float
    acceleration: float
    answer: float
    natural: float


@dataclass(frozen=True)
class Motion:
    """kind; pieces (angle, speed, next angle, next speed), each `length` s long; end in s."""

    kind: str
    pieces: Array
    length: float
    end: float


def draw(kind: str, end: float, sample: float, limits: Limits, rng: Rng) -> Motion:
    """A motion of that kind, about `end` s long, for a record of that sample time."""
    end = round(end / 4e-3) * 4e-3
    if kind in ("ramps", "steps"):
        return _straight(kind, _CORNERED[kind](end, limits, rng), end, sample)
    angle = _SMOOTH[kind](end, limits, rng)
    t: Array = np.arange(round(end / KNOT) + 1, dtype=np.float64) * KNOT
    return _smooth(kind, angle(t), end)


def _smooth(kind: str, angle: Array, end: float) -> Motion:
    """Through the angles at the knots, speeds by central differences of fourth order."""
    wide = np.concatenate([np.full(2, angle[0]), angle, np.full(2, angle[-1])])
    speed = (8 * (wide[3:-1] - wide[1:-3]) - (wide[4:] - wide[:-4])) / (12 * KNOT)
    pieces = np.stack([angle[:-1], speed[:-1], angle[1:], speed[1:]], axis=1)
    return Motion(kind, pieces, KNOT, end)


def _straight(kind: str, corners: list[tuple[float, float]], end: float, sample: float) -> Motion:
    """Straight lines between set-points at the recorder's samples."""
    t: Array = np.arange(round(end / sample) + 1, dtype=np.float64) * sample
    at, value = np.array(corners, dtype=np.float64).T
    angle = np.interp(t, at, value) if kind == "ramps" else _held(t, corners)
    speed = np.diff(angle) / sample
    pieces = np.stack([angle[:-1], speed, angle[1:], speed], axis=1)
    return Motion(kind, pieces, sample, end)


def _held(t: Array, corners: list[tuple[float, float]]) -> Array:
    times, angles = (np.array(c) for c in zip(*corners, strict=True))
    return np.asarray(angles[np.searchsorted(times, t, side="right") - 1])


Course = Callable[[Array], Array]


def _ramp_time(limits: Limits, speed: float) -> float:
    """Time to take up a speed gently: within the acceleration, no faster than the loop answers."""
    return max(1.6 * speed / limits.acceleration, 1.0 / limits.answer)


def _from_speeds(bursts: list[tuple[float, float, float, float]]) -> Course:
    """Sum of smooth bursts of speed (start, rise, flat, speed), each an eased trapezoid."""

    def angle(t: Array) -> Array:
        total = np.zeros_like(t)
        for start, rise, flat, speed in bursts:
            total += speed * (_eased(t - start, rise) - _eased(t - start - rise - flat, rise))
        return total

    return angle


def _eased(u: Array, rise: float) -> Array:
    """Integral of a smooth step (quintic, rest to rest in acceleration and jerk) over `rise`."""
    s = np.clip(u / rise, 0, 1)
    return np.asarray(rise * s**4 * (2.5 - 3 * s + s * s) + np.maximum(u - rise, 0))


def _moves(end: float, limits: Limits, rng: Rng) -> Course:
    """There and back with dwells; speeds differ from move to move."""
    bursts, t, where = [], float(rng.uniform(0.3, 0.8)), 0.0
    sign = float(rng.choice([-1, 1]))
    while True:
        speed = limits.speed * rng.uniform(0.3, 1.0)
        rise = _ramp_time(limits, speed) * rng.uniform(1, 2)
        flat = rng.uniform(0.3, 3.0) * rise
        if t + 2 * rise + flat > end - 0.3:
            break
        bursts.append((t, rise, flat, sign * speed))
        where += sign
        t += 2 * rise + flat + rng.uniform(0.1, 6.0 / limits.answer)
        sign = -float(np.sign(where)) if abs(where) > 1 or rng.random() < 0.7 else sign
        sign = sign or float(rng.choice([-1, 1]))
    return _from_speeds(bursts or [(0.1 * end, 0.2 * end, 0.1 * end, 0.5 * limits.speed)])


def _turns(end: float, limits: Limits, rng: Rng) -> Course:
    """As far as time allows at a constant speed one way, then back."""
    speed = limits.speed * rng.uniform(0.5, 1.0)
    rise = min(_ramp_time(limits, speed) * rng.uniform(1, 2), end / 8)
    flat = (end - 1.0) / 2 - 2 * rise
    if flat <= 0:
        return _moves(end, limits, rng)
    sign = float(rng.choice([-1, 1]))
    return _from_speeds(
        [(0.3, rise, flat, sign * speed), (0.6 + 2 * rise + flat, rise, flat, -sign * speed)]
    )


def _slow_reversals(end: float, limits: Limits, rng: Rng) -> Course:
    """Creeping to and fro."""
    count = int(rng.integers(3, 9))
    half = (end - 0.4) / (2 * count)
    speed = limits.speed * 10 ** rng.uniform(-1.5, -0.5)
    rise = min(_ramp_time(limits, speed), 0.4 * half)
    flat = half - 2 * rise
    return _from_speeds(
        [(0.3 + k * half, rise, flat, speed * (-1.0) ** k) for k in range(2 * count)]
    )


def _jogging(end: float, limits: Limits, rng: Rng) -> Course:
    """Somebody at the keys: taps and holds, either way, at a speed that the hand chooses."""
    bursts, t, tilt = [], float(rng.uniform(0.2, 1.0)), 0.0
    while t < end - 0.5:
        speed = limits.speed * 10 ** rng.uniform(-1.3, 0)
        rise = _ramp_time(limits, speed)
        flat = float(rng.exponential(0.6)) + 0.02
        if t + 2 * rise + flat > end - 0.2:
            break
        sign = -np.sign(tilt) if rng.random() < 0.6 and tilt != 0 else rng.choice([-1, 1])
        tilt += float(sign) * speed * (rise + flat)
        bursts.append((t, rise, flat, float(sign) * speed))
        t += 2 * rise + flat + float(rng.exponential(0.5))
    return _from_speeds(bursts or [(0.1 * end, 0.2 * end, 0.1 * end, 0.3 * limits.speed)])


def _window(t: Array, end: float, rise: float) -> Array:
    """From 0 to 1 and back, smooth at both ends."""
    up, down = np.clip(t / rise, 0, 1), np.clip((end - t) / rise, 0, 1)
    return np.asarray(np.sin(np.pi / 2 * up) ** 4 * np.sin(np.pi / 2 * down) ** 4)


def _multisine(end: float, limits: Limits, rng: Rng) -> Course:
    """Harmonics at random phases, flat in speed until acceleration bounds them."""
    low = max(2.0 / end, 0.02 * limits.answer)
    high = float(rng.uniform(0.3, 1.5)) * limits.answer
    w = 2 * np.pi * low * np.unique(np.round(np.geomspace(1, max(2, high / low), 12)))
    size = np.minimum(limits.speed, 0.5 * limits.acceleration / w) / w
    size *= 0.5 / np.sqrt(len(w))
    phases = rng.uniform(-np.pi, np.pi, len(w))

    def angle(t: Array) -> Array:
        waves = np.sin(np.outer(t, w) + phases) @ size
        return np.asarray(_window(t, end, 0.12 * end) * waves)

    return angle


def _chirp(end: float, limits: Limits, rng: Rng) -> Course:
    """Rising through the loop's own band, at times through the machine's resonance."""
    low = max(1.5 / end, 0.05 * limits.answer / 6)
    top = float(rng.uniform(1.0, 3.0)) * limits.answer / (2 * np.pi)
    if rng.random() < 0.5:
        top = max(top, min(float(rng.uniform(1.1, 1.5)) * limits.natural / (2 * np.pi), 60.0))
    top = max(top, 2 * low)
    share, growth = float(rng.uniform(0.1, 0.5)), float(np.log(top / low))

    def angle(t: Array) -> Array:
        along = low * end / growth * (np.exp(growth * t / end) - 1)
        w = 2 * np.pi * low * np.exp(growth * t / end)
        size = 1 / (w / limits.speed + 2 * w * w / limits.acceleration)
        return np.asarray(share * _window(t, end, 0.08 * end) * size * np.sin(2 * np.pi * along))

    return angle


def _ramps(end: float, limits: Limits, rng: Rng) -> list[tuple[float, float]]:
    """Straight lines from corner to corner: speeds that jump."""
    corners, t, where = [(0.0, 0.0)], float(rng.uniform(0.2, 0.6)), 0.0
    corners.append((t, 0.0))
    while t < end:
        speed = limits.speed * 10 ** rng.uniform(-1, -0.2)
        lasting = float(rng.uniform(1, 8)) / limits.answer + 0.1
        sign = -np.sign(where) if where != 0 and rng.random() < 0.6 else rng.choice([-1, 1])
        if rng.random() < 0.3:
            sign = 0
        t += lasting
        where += float(sign) * speed * lasting
        corners.append((t, where))
    return corners


def _steps(end: float, limits: Limits, rng: Rng) -> list[tuple[float, float]]:
    """Jumps that the loop answers below its speed limit."""
    corners, t, where = [(0.0, 0.0)], float(rng.uniform(0.2, 0.6)), 0.0
    largest = min(0.6 * limits.speed / limits.answer, limits.acceleration / limits.answer**2)
    while t < end:
        jump = largest * 10 ** rng.uniform(-0.7, 0)
        where += (-1 if where > 0 else 1 if where < 0 else float(rng.choice([-1, 1]))) * jump
        corners.append((t, where))
        t += float(rng.uniform(4, 10)) / limits.answer
    return corners


_SMOOTH = {
    "moves": _moves,
    "turns": _turns,
    "slow reversals": _slow_reversals,
    "jogging": _jogging,
    "multisine": _multisine,
    "chirp": _chirp,
}
_CORNERED = {"ramps": _ramps, "steps": _steps}
KINDS = (*_SMOOTH, *_CORNERED)
