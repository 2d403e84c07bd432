"""How much a record tells: log-likelihood ratios under the noise that the generator knows.

The difference of two courses of a channel goes through the innovations filter of its sensor's
noise (`sensors.Sensor.whiten`; stamps that jitter count as white, by the mean square of the slope).
Squares of what is left, summed and halved, are a log-likelihood ratio. The simpler machine gets
the numbers under which it comes nearest: the nominal ones
within their tolerances, and a constant of every channel but the table's angle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from tests.blind.generator import machines
from tests.blind.generator.effects import Hidden
from tests.blind.generator.engine import Array
from tests.blind.generator.records import Plan
from tests.blind.generator.sensors import Recorder

_NUDGE = 0.01


@dataclass(frozen=True)
class Bench:
    """One case's machine (true numbers), records, noise and channels."""

    machine: Mapping[str, float]
    plans: Sequence[Plan]
    recorder: Recorder
    channels: tuple[str, ...]
    _constants: dict[tuple[str, str], Array] = field(default_factory=dict, repr=False)

    def record(
        self, effects: tuple[Hidden, ...] = (), factors: Mapping[str, float] | None = None
    ) -> list[dict[str, Array]]:
        """Noise-free records of the machine, numbers times factors."""
        factors = factors or {}
        machine = {p: v * factors.get(p, 1.0) for p, v in self.machine.items()}
        return [plan.truth(machine, effects, coarse=True) for plan in self.plans]

    def whitened(self, made: list[dict[str, Array]], base: list[dict[str, Array]]) -> Array:
        """made - base in units of the noise, all records and channels in one long vector.

        Every channel but the table's angle has a constant of its own: that part is taken out.
        """
        rows = []
        for plan, own, other in zip(self.plans, made, base, strict=True):
            for name in self._sensed():
                row = self._white(plan, name, own[name] - other[name], other[name])
                if name != "theta_m":
                    constant = self._constant(plan, name, other[name])
                    row = row - constant * (constant @ row)
                rows.append(row)
        return np.concatenate(rows)

    def _constant(self, plan: Plan, name: str, course: Array) -> Array:
        """A constant of that channel, whitened, of length one."""
        if (plan.name, name) not in self._constants:
            unit = np.full(len(course), self.recorder.sensors[name].rms)
            white = self._white(plan, name, unit, course)
            self._constants[plan.name, name] = white / np.linalg.norm(white)
        return self._constants[plan.name, name]

    def _sensed(self) -> list[str]:
        return [name for name in self.channels if name not in ("theta_ref", "omega_ref")]

    def _white(self, plan: Plan, name: str, change: Array, course: Array) -> Array:
        slope = float(np.mean(np.diff(course) ** 2)) / plan.sample**2
        late = slope * self.recorder.jitter**2
        return self.recorder.sensors[name].whiten(change, plan.sample, late)


class Nominals:
    """Slopes of the records by the uncertain numbers, whitened, with their tolerances."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.names = [p for p in machines.UNCERTAIN if bench.machine.get(p, 0) > 0]
        self.base = bench.record()
        self._tolerance = np.array([machines.UNCERTAIN[p] for p in self.names])
        columns = [
            bench.whitened(bench.record(factors={p: 1 + _NUDGE}), self.base) * (s / _NUDGE)
            for p, s in zip(self.names, self._tolerance, strict=True)
        ]
        self.slopes = np.stack(columns, axis=1)
        self._normal = np.linalg.inv(self.slopes.T @ self.slopes + np.eye(len(self.names)))

    def left(self, change: Array) -> tuple[Array, Array]:
        """What is left of a change once the numbers have followed it, and their step in sigmas."""
        step = self._normal @ (self.slopes.T @ change)
        return change - self.slopes @ step, step

    def change(self, hidden: tuple[Hidden, ...]) -> Array:
        """What effects change in the records, in units of the noise."""
        return self.bench.whitened(self.bench.record(hidden), self.base)

    def ratio(self, change: Array) -> float:
        """Log-likelihood ratio to first order."""
        left, step = self.left(change)
        return float(left @ left + step @ step) / 2

    def best_ratio(self, made: list[dict[str, Array]], steps: int = 3) -> float:
        """The least that was met on so many steps of Gauss and Newton from the true numbers."""
        residual = self.bench.whitened(made, self.base)
        best, z = float(residual @ residual) / 2, np.zeros(len(self.names))
        for _ in range(steps):
            z = np.clip(z + self._normal @ (self.slopes.T @ residual - z), -4, 4)
            factors = {
                p: float(np.exp(np.clip(s * t, -0.7, 0.7)))
                for p, s, t in zip(self.names, z, self._tolerance, strict=True)
            }
            residual = self.bench.whitened(made, self.bench.record(factors=factors))
            size = float(residual @ residual + z @ z) / 2
            if size > 0.98 * best:
                return min(size, best)
            best = size
        return best
