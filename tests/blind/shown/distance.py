"""How far a true record lies from what a simpler machine can produce, in units of the known noise.

The channels are those a user looks at: following error, currents, deflections, each with the noise
of its sensors.

lambda: squared distance to the nearest record of the machine without the effect, its nominal
numbers free within their tolerances; each channel's constant is given away but that of e. Linear in
the numbers around the true ones, then checked there by two Gauss-Newton steps. delta-lambda: the
same to the nearest rival effect, lambda (1 - c^2), c the correlation after the nominal numbers
are projected out of both (to first order in the rival's size).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator.effects import Hidden
from tests.blind.generator.machines import UNCERTAIN
from tests.blind.shown.records import Plan, Recorder, headline

Array = NDArray[np.float64]
COARSE = 4e-5
_NUDGE = 0.01


@dataclass(frozen=True)
class Bench:
    """One case's machine (true numbers), records and noise; simulates and whitens."""

    machine: Mapping[str, float]
    plans: Sequence[Plan]
    recorder: Recorder

    def record(
        self, effects: tuple[Hidden, ...] = (), factors: Mapping[str, float] | None = None
    ) -> Array:
        """Whitened channels of both records, one long vector; offsets removed."""
        factors = factors or {}
        machine = {p: v * factors.get(p, 1.0) for p, v in self.machine.items()}
        return self._records(machine, effects)

    def tense(self) -> Bench:
        """The same, of the records in which tension keeps the flanks closed."""
        most = max(plan.T_ten for plan in self.plans)
        return replace(self, plans=[plan for plan in self.plans if plan.T_ten > 0.25 * most])

    def apart(self, sheet: Mapping[str, float]) -> float:
        """Squared distance of the true records from those of the sheet's machine."""
        change = self._records(self.machine, ()) - self._records(sheet, ())
        return float(change @ change)

    def _records(self, machine: Mapping[str, float], effects: tuple[Hidden, ...]) -> Array:
        rows = []
        for plan in self.plans:
            shown = headline(machine, plan.truth(machine, effects, step=COARSE))
            rows += [self._white(plan, name, values) for name, values in shown.items()]
        return np.concatenate(rows)

    def _white(self, plan: Plan, name: str, values: Array) -> Array:
        n = len(values)
        bins = np.fft.rfft(values, norm="ortho")
        bins = bins * np.sqrt(2.0 / self._spectrum(name, n, plan.sample))
        first = 0 if name == "e" else 1  # the zero of every other channel is its own
        return np.concatenate([bins[first:].real, bins[first:].imag])

    def _spectrum(self, name: str, n: int, dt: float) -> Array:
        """Noise of a headline channel, from that of the sensors it is made of."""
        table = self.recorder.sensors["theta_m"].spectrum(n, dt)
        if name == "e":
            return table
        if name[0] == "I":
            return self.recorder.sensors[name].spectrum(n, dt)
        motor = self.recorder.sensors[f"theta_{name[-1]}"].spectrum(n, dt)
        i, i_m = self.machine["gearboxes.ratio"], self.machine["meshes.ratio"]
        return motor / i**2 + table * i_m**2


class Nominals:
    """Derivatives of the records by the uncertain numbers, whitened, with their tolerances."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.names = [p for p in UNCERTAIN if bench.machine.get(p, 0) > 0]
        self.at_truth = bench.record()
        slopes = [
            (bench.record(factors={p: 1 + _NUDGE}) - self.at_truth) / _NUDGE for p in self.names
        ]
        tolerance = np.array([UNCERTAIN[p] for p in self.names])
        self.slopes = np.stack(slopes, axis=1) * tolerance  # by one sigma of each
        self._normal = np.linalg.inv(self.slopes.T @ self.slopes + np.eye(len(self.names)))
        self._tolerance = tolerance

    def project(self, change: Array) -> tuple[Array, Array]:
        """What is left of a change once the nominal numbers have followed it; and their step."""
        step = self._normal @ (self.slopes.T @ change)
        return change - self.slopes @ step, step

    def distance(self, changed: Array) -> float:
        """lambda of that record: nominal numbers refitted, the tolerances' penalty counted."""
        left, step = self.project(changed - self.at_truth)
        best = float(left @ left + step @ step)
        z = step
        for _ in range(2):
            factors = {
                p: float(np.exp(np.clip(s * t, -0.7, 0.7)))
                for p, s, t in zip(self.names, z, self._tolerance, strict=True)
            }
            residual: Array = changed - self.bench.record(factors=factors)
            best = min(best, float(residual @ residual + z @ z))
            z = z + self._normal @ (self.slopes.T @ residual - z)
        return best
