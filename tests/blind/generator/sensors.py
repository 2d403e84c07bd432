"""What a recorder adds: noise of any colour, a converter's steps, a drifting zero, late stamps.

Noise is a linear state model driven by white numbers, so that its covariance is known: `whiten`
is the exact steady-state innovations filter of what `Sensor.read` adds (rounding counts as white).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_discrete_are
from scipy.signal import butter, lfilter, sosfilt, tf2ss, zpk2sos

Array = NDArray[np.float64]
Rng = np.random.Generator
COLOURS = ("white", "autoregressive", "pink", "filtered")
_DECADES = 4.0 ** np.arange(6)  # correlation times of 1/f noise, in samples
_WANDER = 60.0  # s: correlation time of a zero that drifts


@dataclass(frozen=True)
class Sensor:
    """rms of the noise, its colour and that colour's number, converter's step, rms of the drift.

    number: pole of the autoregression, or corner of the filter over half the sampling rate
    """

    rms: float
    colour: str
    number: float
    step: float
    drift: float

    def read(self, values: Array, dt: float, rng: Rng) -> Array:
        """The values as they are stored, shape (n,)."""
        n = len(values)
        noisy = values + self.rms * self._noise(rng, n)
        if self.drift > 0:
            noisy = noisy + self.drift * _first_order(np.exp(-dt / _WANDER), rng, n)
        return np.asarray(np.round(noisy / self.step) * self.step)

    def _noise(self, rng: Rng, n: int) -> Array:
        """Of variance one."""
        if self.colour == "autoregressive":
            return _first_order(self.number, rng, n)
        if self.colour == "pink":
            parts = [_first_order(float(np.exp(-1 / m)), rng, n) for m in _DECADES]
            return np.asarray(np.sum(parts, axis=0) / np.sqrt(len(parts)))
        if self.colour == "filtered":
            b, a, size = _low_pass(self.number)
            return np.asarray(lfilter(b, a, rng.normal(size=n + 200))[200:] / size)
        return rng.normal(size=n)

    def whiten(self, change: Array, dt: float, more: float = 0.0) -> Array:
        """A difference of two courses of the channel, in units of the noise, shape (n,).

        more: variance of what else is white: stamps that jitter
        """
        floor = (self.step / 12**0.5) ** 2 + more + 1e-6 * self.rms**2
        sos, size = _whitener(
            self.colour, self.number, floor / self.rms**2, self.drift / self.rms, dt
        )
        return np.asarray(sosfilt(sos, change / self.rms) / size)


def _first_order(a: float, rng: Rng, n: int) -> Array:
    """Autoregression of the first order, of variance one from the first sample on."""
    kicks = rng.normal(size=n) * np.sqrt(1 - a * a)
    kicks[0] /= np.sqrt(1 - a * a)
    return np.asarray(lfilter([1.0], [1.0, -a], kicks))


@lru_cache(maxsize=64)
def _low_pass(corner: float) -> tuple[Array, Array, float]:
    """Butterworth filter of second order, and the rms that it leaves of white noise."""
    b, a = butter(2, corner)
    pulse = np.zeros(4000)
    pulse[0] = 1
    return b, a, float(np.sqrt(np.sum(lfilter(b, a, pulse) ** 2)))


@lru_cache(maxsize=256)
def _whitener(
    colour: str, number: float, floor: float, drift: float, dt: float
) -> tuple[Array, float]:
    """Innovations filter of noise of variance one above a white floor, and the innovations' rms."""
    first = {"autoregressive": [number], "pink": list(np.exp(-1 / _DECADES))}.get(colour, [])
    weight = [1 / max(1, len(first))] * len(first)
    if drift > 0:
        first, weight = [*first, float(np.exp(-dt / _WANDER))], [*weight, drift**2]
    A = np.diag(first) if first else np.zeros((0, 0))
    Q = np.diag([w * (1 - a * a) for a, w in zip(first, weight, strict=True)]) if first else A
    C = np.ones((1, len(first)))
    R, S = floor, np.zeros((len(first), 1))
    if colour == "white":
        R += 1.0
    if colour == "filtered":
        b, a, size = _low_pass(number)
        own, into, out, through = tf2ss(b / size, a)
        A, Q = block_diag(A, own), block_diag(Q, into @ into.T)
        C = np.hstack([C, out])
        R += float(through[0, 0] ** 2)
        S = np.vstack([S, into * through[0, 0]])
    if len(A) == 0:
        return zpk2sos([], [], 1.0), float(np.sqrt(R))
    P = solve_discrete_are(A.T, C.T, Q, np.array([[R]]), s=S)
    size = float((C @ P @ C.T)[0, 0] + R)
    gain = (A @ P @ C.T + S) / size
    zeros, poles = np.linalg.eigvals(A), np.linalg.eigvals(A - gain @ C)
    sections = zpk2sos(zeros.tolist(), poles.tolist(), 1.0)
    return np.asarray(sections, np.float64), float(np.sqrt(size))


@dataclass(frozen=True)
class Recorder:
    """Sensors by channel, and a clock whose stamps jitter by so many seconds rms."""

    sensors: Mapping[str, Sensor]
    jitter: float

    def read(
        self, truth: Mapping[str, Array], channels: tuple[str, ...], dt: float, rng: Rng
    ) -> dict[str, Array]:
        """Recorded columns: stamps, the command if it is a channel, what sensors read."""
        late = rng.normal(scale=self.jitter or 1.0, size=len(truth["t"]))
        most = 0.2 * dt
        jittered = truth["t"] + np.clip(late, -most, most)
        read = {"t": np.round(jittered if self.jitter else truth["t"], 8)}
        for name in channels:
            exact = name in ("theta_ref", "omega_ref")
            values = truth[name]
            read[name] = values if exact else self.sensors[name].read(values, dt, rng)
        return read


def draw(machine: Mapping[str, float], dt: float, rng: Rng) -> Recorder:
    """Sensors of one quality throughout, good or bad; the clock jitters in half of the cases."""
    drives = int(machine["drives"])
    i, rated = machine["gearboxes.ratio"], machine["motors.T_rated"]
    twist = rated * i / machine["meshes.stiffness"]  # what rated torque bends a mesh by
    colour = str(rng.choice(COLOURS))
    drifting = rng.random() < 0.3
    sizes = {
        "theta_m": twist / machine["meshes.ratio"] * 10 ** rng.uniform(-3.5, -1.5),
        "theta": twist * i * 10 ** rng.uniform(-3.5, -1.3),
        "I": rated / machine["motors.K_d"] * 10 ** rng.uniform(-3, -1.7),
    }
    numbers = {
        "autoregressive": float(rng.choice([0.5, 0.7, 0.8, 0.9, 0.95, 0.98])),
        "filtered": round(float(rng.uniform(0.05, 0.5)), 2),
    }
    coarse = {kind: 10 ** rng.uniform(-0.7, 0.6) for kind in sizes}
    sensors = {}
    for name in ["theta_m", *(f"{k}_{n}" for n in range(1, drives + 1) for k in ("theta", "I"))]:
        kind = name if name == "theta_m" else name.split("_")[0]
        rms = float(f"{sizes[kind]:.3g}")
        step = float(f"{rms * coarse[kind]:.3g}")
        drift = round(2 * float(rng.random()), 2) * rms if drifting else 0.0
        sensors[name] = Sensor(rms, colour, numbers.get(colour, 0.0), step, drift)
    for n in range(1, drives + 1):
        K_d, own = machine["motors.K_d"], sensors[f"I_{n}"]
        scaled = (own.rms * K_d, own.step * K_d, own.drift * K_d)
        sensors[f"T_{n}"] = Sensor(scaled[0], own.colour, own.number, scaled[1], scaled[2])
    jitter = 0.0 if rng.random() < 0.5 else float(f"{dt * 10 ** rng.uniform(-3, -1.3):.2g}")
    return Recorder(sensors, jitter)
