"""A rigid axis with friction, written plainly: what a machine must offer to a torque balance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify import Balance, Declared

Array = NDArray[np.float64]

UNITS = {
    "table.J": "kg*m^2",
    "table.b": "N*m*s/rad",
    "coulomb@table.torque": "N*m",
    "motor_1.J": "kg*m^2",
}
BOUNDS = {"motor_1.J": (0.0, np.inf), "table.J": (0.0, np.inf)}


@dataclass(frozen=True)
class RigidAxis:
    """J α + b ω + F_c sign ω + what else is named in ``values`` − T_1."""

    values: Mapping[str, float] = field(default_factory=lambda: {"table.J": 50.0, "table.b": 0.0})

    def parameters(self) -> list[Declared]:
        return [self.declared(path) for path in self.values]

    def declared(self, path: str) -> Declared:
        if path not in self.values:
            raise ValueError(f"no parameter {path!r}")
        low, high = BOUNDS.get(path, (-np.inf, np.inf))
        return Declared(path, UNITS[path], low, high, self.values[path])

    def with_values(self, values: Mapping[str, float]) -> RigidAxis:
        return replace(self, values={**self.values, **values})

    def balance(self, samples: Mapping[str, Array], parameters: Sequence[str]) -> Balance:
        nothing = np.zeros_like(samples["omega_m"])
        columns = {
            "table.J": samples["alpha_m"],
            "table.b": samples["omega_m"],
            "coulomb@table.torque": np.sign(samples["omega_m"]),
            "motor_1.J": samples.get("alpha_1", nothing),
        }
        measured = samples["T_1"]
        model = sum((self.values[p] * columns[p] for p in self.values), nothing)
        return Balance(
            ("m",),
            (model - measured)[None],
            np.stack([columns[p] for p in parameters], axis=-1)[None],
            measured[None],
        )


@dataclass(frozen=True)
class Recorded:
    """A trace: times and channels."""

    t: Array
    channels: Mapping[str, Array]
