"""What the reference model is told to do: commanded motion and load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

from scipy.optimize import brentq


@dataclass(frozen=True)
class Motion:
    """Commanded motion and load: generator states set anew at given times, plus sines from t = 0.

    Between its breakpoints θ_ref is a cubic and T_load (> 0 opposes positive motion) a line.
    """

    breakpoints: tuple[tuple[float, Mapping[str, float]], ...] = ()
    sines: tuple[tuple[float, float, float], ...] = ()  # amplitude rad, frequency Hz, phase rad

    def __add__(self, later: Motion) -> Motion:
        points = sorted(self.breakpoints + later.breakpoints, key=lambda point: point[0])
        return Motion(tuple(points), self.sines + later.sines)


def step(size: float, at: float = 0.0) -> Motion:
    return Motion(((at, {"theta_ref": size}),))


def sine(amplitude: float, frequency: float, phase: float = 0.0) -> Motion:
    return Motion(sines=((amplitude, frequency, phase),))


def load_ramp(rate: float, start: float = 0.0) -> Motion:
    return Motion(((start, {"load_rate": rate}),))


def move(
    distance: float, v: float, a: float, j: float, start: float, origin: float = 0.0
) -> Motion:
    """Return the shortest rest-to-rest move with speed, acceleration and jerk within v, a and j.

    The speed rises under jerk +j, 0, −j, holds, and falls likewise.
    """
    direction, distance = (1.0 if distance > 0 else -1.0), abs(distance)

    def ramp(
        top: float,
    ) -> tuple[float, float]:  # durations of constant jerk, constant acceleration
        return (a / j, top / a - a / j) if top >= a * a / j else (sqrt(top / j), 0.0)

    def length(
        top: float,
    ) -> float:  # distance covered by speeding up to top and slowing down again
        return top * (2 * ramp(top)[0] + ramp(top)[1])

    if length(v) > distance:
        v = float(brentq(lambda top: length(top) - distance, 0.0, v, xtol=1e-18, rtol=1e-15))
    t_j, t_a = ramp(v)
    t_v = (distance - length(v)) / v
    pieces = zip((t_j, t_a, t_j, t_v, t_j, t_a, t_j), (j, 0.0, -j, 0.0, -j, 0.0, j), strict=True)
    t, angle, speed, acceleration = start, 0.0, 0.0, 0.0
    points: list[tuple[float, Mapping[str, float]]] = []
    for span, jerk in pieces:
        point = {"alpha_ref": acceleration, "jerk_ref": jerk, "omega_ref": speed}
        point = {name: direction * value for name, value in point.items()}
        points.append((t, point | {"theta_ref": origin + direction * angle}))
        t += span
        angle += speed * span + acceleration * span**2 / 2 + jerk * span**3 / 6
        speed += acceleration * span + jerk * span**2 / 2
        acceleration += jerk * span
    rest = {
        "theta_ref": origin + direction * distance,
        "omega_ref": 0,
        "alpha_ref": 0,
        "jerk_ref": 0,
    }
    return Motion((*points, (t, rest)))
