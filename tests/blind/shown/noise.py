"""What a recorder adds: coloured and white noise, steps of the converter, a clock that jitters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sensor:
    """rms of all noise, coloured share of its variance, correlation time, converter's step."""

    rms: float
    coloured: float
    correlation: float
    step: float

    def read(self, values: Array, dt: float, rng: np.random.Generator) -> Array:
        """The values as they are stored, shape (n,)."""
        n = len(values)
        a = np.exp(-dt / self.correlation)
        kicks = rng.normal(size=n) * np.sqrt(1 - a * a)
        slow = np.empty(n)
        last = rng.normal()
        for k in range(n):
            slow[k] = last = a * last + kicks[k]
        noise = np.sqrt(self.coloured) * slow + np.sqrt(1 - self.coloured) * rng.normal(size=n)
        return np.asarray(np.round((values + self.rms * noise) / self.step) * self.step)

    def spectrum(self, n: int, dt: float) -> Array:
        """Variance of each bin of an orthonormal FFT of n samples; rounding counts as white."""
        a = np.exp(-dt / self.correlation)
        angle = 2 * np.pi * np.fft.rfftfreq(n)
        slow = (1 - a * a) / (1 - 2 * a * np.cos(angle) + a * a)
        flat = self.rms**2 * (1 - self.coloured) + self.step**2 / 12
        return np.asarray(self.rms**2 * self.coloured * slow + flat)


def draw(rms: float, step: float, rng: np.random.Generator) -> Sensor:
    """A sensor of about that quality."""
    return Sensor(
        rms=float(rms * 2 ** rng.uniform(-1, 1)),
        coloured=float(rng.uniform(0.3, 0.9)),
        correlation=float(1e-3 * 20 ** rng.uniform(0, 1)),
        step=float(step),
    )


def jitter(t: Array, rms: float, rng: np.random.Generator) -> Array:
    """Stamps of samples that were taken at `t`; kept in order, to the microsecond or better."""
    if rms == 0:
        return t
    most = 0.2 * float(t[1] - t[0])
    late = np.clip(rng.normal(scale=rms, size=len(t)), -most, most)
    return np.asarray(np.round(t + late, 7))
